#include "filters/component_stage.h"

#include <array>
#include <utility>
#include <vector>

namespace isobrick::inline v0 {

ComponentStage::ComponentStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
                               std::uint64_t memory, const ComponentChoice& choice)
    : FilterStage(next, std::move(cancel)),
      choice_(choice),
      spool_(place, memory / 8 * 3),
      sets_(place, memory / 4),
      sizes_(place, memory / 8),
      numbers_(place, memory / 4) {}

void ComponentStage::begin(const MeshHeader& header) {
  spool_.begin(header);
  next().begin(header);
}

void ComponentStage::write(const MeshChunk& chunk) {
  check_cancelled();
  spool_.append(chunk);
  sets_.grow(spool_.size().vertices);
  for (const Triangle& triangle : chunk.triangles) sets_.connect(triangle);
}

void ComponentStage::count_triangles() {
  sets_.flatten();
  sizes_.resize(sets_.size());
  spool_.triangles().for_each_run([&](std::span<const Triangle> run, std::uint64_t) {
    check_cancelled();
    for (const Triangle& triangle : run) ++sizes_.edit(sets_.root(triangle[0]));
  });
}

template <class F>
void ComponentStage::for_each_component(F&& f) {
  for (std::uint64_t v = 0; v < sets_.size(); ++v) {
    if (v % (1 << 16) == 0) check_cancelled();
    if (sets_.root(v) != v) continue;
    std::uint64_t size = sizes_[v];
    const std::uint64_t before = size;
    f(size);
    if (size != before) sizes_.edit(v) = size;
  }
}

/// Counts sizes by their digits of 16 bits, the highest first: three passes, whatever the number of
/// components.
ComponentStage::Threshold ComponentStage::find_threshold() {
  if (choice_.largest == 0 || choice_.largest >= sets_.sets()) return {};
  constexpr int digit_bits = 16;
  Threshold threshold{.equal = choice_.largest};
  std::vector<std::uint64_t> counts;
  for (int shift = 2 * digit_bits; shift >= 0; shift -= digit_bits) {
    counts.assign(std::size_t{1} << digit_bits, 0);
    for_each_component([&](std::uint64_t& size) {
      if (size >> shift >> digit_bits == threshold.triangles)
        ++counts[(size >> shift) & (counts.size() - 1)];
    });
    std::size_t digit = counts.size() - 1;
    for (; counts[digit] < threshold.equal; --digit) threshold.equal -= counts[digit];
    threshold.triangles = threshold.triangles << digit_bits | digit;
  }
  return threshold;
}

void ComponentStage::choose() {
  Threshold threshold = find_threshold();
  const bool all = threshold.triangles == 0;
  for_each_component([&](std::uint64_t& size) {
    bool is_large = all || size > threshold.triangles;
    if (!is_large && size == threshold.triangles && threshold.equal > 0) {
      is_large = true;
      --threshold.equal;
    }
    if (!is_large || size < choice_.min_triangles) size = 0;
  });
}

void ComponentStage::number_vertices() {
  numbers_.resize(sets_.size());
  for (std::uint64_t v = 0; v < sets_.size(); ++v) {
    if (v % (1 << 16) == 0) check_cancelled();
    const std::uint32_t root = sets_.root(v);
    if (root == VertexSets::kNone || sizes_[root] == 0) continue;
    numbers_.edit(v) = static_cast<std::uint32_t>(++kept_vertices_);
  }
}

void ComponentStage::write_vertices() {
  std::vector<Vec3f> positions, normals;
  std::uint64_t first_vertex = 0;
  spool_.positions().for_each_run([&](std::span<const Vec3f> run, std::uint64_t first) {
    check_cancelled();
    positions.clear();
    normals.clear();
    for (std::size_t i = 0; i < run.size(); ++i) {
      if (numbers_[first + i] == 0) continue;
      positions.push_back(run[i]);
      if (spool_.has_normals()) normals.push_back(spool_.normals()[first + i]);
    }
    if (positions.empty()) return;
    next().write({.first_vertex = first_vertex, .positions = positions, .normals = normals});
    first_vertex += positions.size();
  });
}

void ComponentStage::write_triangles() {
  std::vector<Triangle> kept;
  spool_.triangles().for_each_run([&](std::span<const Triangle> run, std::uint64_t) {
    check_cancelled();
    kept.clear();
    for (const Triangle& t : run) {
      const std::uint32_t a = numbers_[t[0]];
      if (a != 0) kept.push_back({a - 1, numbers_[t[1]] - 1, numbers_[t[2]] - 1});
    }
    if (!kept.empty()) next().write({.first_vertex = kept_vertices_, .triangles = kept});
  });
}

void ComponentStage::finish() {
  count_triangles();
  choose();
  number_vertices();
  sets_.release();
  sizes_.release();
  write_vertices();
  write_triangles();
  spool_.release();
  numbers_.release();
  next().finish();
}

}  // namespace isobrick

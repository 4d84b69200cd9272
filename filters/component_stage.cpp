#include "filters/component_stage.h"

#include <array>
#include <utility>
#include <vector>

namespace isobrick::inline v0 {

template <class Number>
ComponentStage<Number>::ComponentStage(MeshSink& next, std::stop_token cancel,
                                       const ScratchPlace& place, std::uint64_t memory,
                                       const ComponentChoice& choice,
                                       std::uint64_t max_narrow_vertices)
    : FilterStage(next, std::move(cancel)),
      choice_(choice),
      max_narrow_vertices_(max_narrow_vertices),
      spool_(place, memory / 8 * 3),
      sets_(place, memory / 4),
      sizes_(place, memory / 8),
      numbers_(place, memory / 4) {}

template <class Number>
void ComponentStage<Number>::begin(const MeshHeader& header) {
  spool_.begin(header);
  header_ = header;
  if constexpr (!kIsWide<Number>) begin_next();
}

template <class Number>
void ComponentStage<Number>::write(const MeshChunk& chunk) {
  check_cancelled();
  spool_.append(chunk);
  sets_.grow(spool_.size().vertices);
  for (const auto& triangle : triangles_of<Number>(chunk, converted_)) sets_.connect(triangle);
}

template <class Number>
void ComponentStage<Number>::count_triangles() {
  sets_.flatten();
  sizes_.resize(sets_.size());
  spool_.triangles().for_each_run([&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
    check_cancelled();
    for (const auto& triangle : run) ++sizes_.edit(sets_.root(triangle[0]));
  });
}

template <class Number>
template <class F>
void ComponentStage<Number>::for_each_component(F&& f) {
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
template <class Number>
typename ComponentStage<Number>::Threshold ComponentStage<Number>::find_threshold() {
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

template <class Number>
void ComponentStage<Number>::choose() {
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

template <class Number>
void ComponentStage<Number>::number_vertices() {
  numbers_.resize(sets_.size());
  for (std::uint64_t v = 0; v < sets_.size(); ++v) {
    if (v % (1 << 16) == 0) check_cancelled();
    const Number root = sets_.root(v);
    if (root == VertexSets<Number>::kNone || sizes_[root] == 0) continue;
    numbers_.edit(v) = static_cast<Number>(++kept_vertices_);
  }
}

/// With numbers of 64 bits it is not known before how many vertices stay.
template <class Number>
void ComponentStage<Number>::begin_next() {
  header_.wide = kept_vertices_ > max_narrow_vertices_;
  check_takes(next(), header_.wide, kept_vertices_);
  next().begin(header_);
}

template <class Number>
void ComponentStage<Number>::write_vertices() {
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

template <class Number>
void ComponentStage<Number>::write_triangles() {
  std::vector<TriangleOf<Number>> kept;
  spool_.triangles().for_each_run([&](std::span<const TriangleOf<Number>> run, std::uint64_t) {
    check_cancelled();
    kept.clear();
    for (const auto& t : run) {
      const Number a = numbers_[t[0]];
      if (a != 0) kept.push_back({a - 1, numbers_[t[1]] - 1, numbers_[t[2]] - 1});
    }
    if (!kept.empty())
      isobrick::write_triangles<Number>(next(), header_.wide, kept_vertices_, kept);
  });
}

template <class Number>
void ComponentStage<Number>::finish() {
  count_triangles();
  choose();
  number_vertices();
  sets_.release();
  sizes_.release();
  if constexpr (kIsWide<Number>) begin_next();
  write_vertices();
  write_triangles();
  spool_.release();
  numbers_.release();
  next().finish();
}

template class ComponentStage<std::uint32_t>;
template class ComponentStage<std::uint64_t>;

}  // namespace isobrick

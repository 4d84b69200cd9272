#include "io/meshes/levels/level_fragments.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <string>

#include <isobrick/error.h>
#include "core/cancel.h"
#include "io/meshes/levels/draco_mesh.h"
#include "io/meshes/levels/lattice_cut.h"

namespace isobrick::inline v0 {
namespace {

/// The triangles of a fragment, and what they become.
struct Fragment {
  std::uint64_t key = 0;
  std::vector<std::array<Vec3f, 3>> triangles;
  std::string encoded;
  std::uint8_t halves = 0;
};

/// What a thread keeps from fragment to fragment.
struct Encoder {
  LatticeCut cut;
  FragmentWelder welder;

  Encoder(const ChunkGrid& grid, int level) : cut(grid, level) {}

  void encode(Fragment& fragment, const ChunkGrid& grid, int level);
};

void Encoder::encode(Fragment& fragment, const ChunkGrid& grid, int level) {
  const GridCell place = cell_of_key(fragment.key);
  const std::uint32_t halves = cut.halves();
  welder.begin(fragment.triangles.size());
  for (const std::array<Vec3f, 3>& t : fragment.triangles) {
    const LatticeTriangle corners{grid.quantize(t[0], level), grid.quantize(t[1], level),
                                  grid.quantize(t[2], level)};
    cut.for_each_piece(corners, [&](const LatticeTriangle& piece, const GridCell& cell) {
      unsigned half = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (cell[axis] / halves != place[axis]) return;
        half |= (cell[axis] % halves) << axis;
      }
      fragment.halves = static_cast<std::uint8_t>(fragment.halves | 1U << half);
      std::array<FragmentPoint, 3> points;
      for (std::size_t corner = 0; corner < 3; ++corner)
        for (std::size_t axis = 0; axis < 3; ++axis)
          points[corner][axis] = static_cast<std::uint16_t>(
              piece[corner][axis] - std::int64_t{place[axis]} * ChunkGrid::kSteps);
      welder.add(points);
    });
  }
  fragment.encoded = encode_draco(welder.mesh());
  fragment.triangles = {};
}

}  // namespace

std::uint64_t z_order_key(const GridCell& cell) {
  std::uint64_t key = 0;
  for (unsigned bit = 0; bit < 21; ++bit)
    for (unsigned axis = 0; axis < 3; ++axis)
      key |= std::uint64_t{cell[axis] >> bit & 1} << (3 * bit + axis);
  return key;
}

GridCell cell_of_key(std::uint64_t key) {
  GridCell cell{};
  for (unsigned bit = 0; bit < 21; ++bit)
    for (unsigned axis = 0; axis < 3; ++axis)
      cell[axis] |= static_cast<std::uint32_t>(key >> (3 * bit + axis) & 1) << bit;
  return cell;
}

LevelFragments::LevelFragments(MeshSpool& mesh, const ChunkGrid& grid, int level,
                               const FragmentWork& work)
    : mesh_(mesh), grid_(grid), level_(level), work_(work), sorted_(work.place, work.memory) {
  for_each_touched([](const Triangle&, Run& run) { ++run.end; });
}

LatticeTriangle LevelFragments::on_lattice(const Triangle& triangle) {
  LatticeTriangle t;
  for (std::size_t corner = 0; corner < 3; ++corner)
    t[corner] = grid_.quantize(mesh_.positions()[triangle[corner]], level_);
  return t;
}

void LevelFragments::advance(std::uint64_t triangles) const {
  if (cancel_requested()) throw Cancelled("the operation was cancelled");
  work_.progress->advance(triangles * sizeof(Triangle));
}

template <class F>
void LevelFragments::for_each_touched(F&& f) {
  const LatticeCut cut(grid_, level_);
  GridCell last{};
  Run* run_of_last = nullptr;  // mostly it is the next one's, too
  mesh_.triangles().for_each_run([&](std::span<const Triangle> triangles, std::uint64_t) {
    advance(triangles.size());
    for (const Triangle& t : triangles)
      cut.for_each_fragment(on_lattice(t), [&](const GridCell& cell) {
        if (!run_of_last || cell != last) run_of_last = &runs_[z_order_key(cell)];
        last = cell;
        f(t, *run_of_last);
      });
  });
}

std::uint64_t LevelFragments::largest() const {
  std::uint64_t most = 0;
  for (const auto& [key, run] : runs_) most = std::max(most, run.size());
  return most;
}

void LevelFragments::sort() {
  std::uint64_t end = 0;
  for (auto& [key, run] : runs_) {
    const std::uint64_t count = run.size();
    run = {end, end};
    end += count;
  }
  sorted_.resize(end);
  for_each_touched([&](const Triangle& t, Run& run) { sorted_.edit(run.end++) = t; });
}

std::vector<std::array<Vec3f, 3>> LevelFragments::load(const Run& run) {
  std::vector<std::array<Vec3f, 3>> triangles;
  triangles.reserve(static_cast<std::size_t>(run.size()));
  sorted_.for_each_run(run.begin, run.end, [&](std::span<const Triangle> part, std::uint64_t) {
    for (const Triangle& t : part) {
      auto& corners = triangles.emplace_back();
      for (std::size_t corner = 0; corner < 3; ++corner)
        corners[corner] = mesh_.positions()[t[corner]];
    }
  });
  return triangles;
}

std::vector<EncodedFragment> LevelFragments::encode(
    const std::function<void(std::string_view)>& write) {
  sort();
  tbb::task_arena arena(work_.threads > 0 ? work_.threads : tbb::task_arena::automatic);
  tbb::enumerable_thread_specific<Encoder> encoders([&] { return Encoder(grid_, level_); });
  std::vector<EncodedFragment> encoded;
  std::vector<Fragment> batch;
  for (auto at = runs_.cbegin(); at != runs_.cend();) {
    batch.clear();
    std::uint64_t triangles = 0;
    do {
      triangles += at->second.size();
      batch.push_back({.key = at->first, .triangles = load(at->second)});
    } while (++at != runs_.cend() && triangles + at->second.size() <= work_.triangles_at_once);
    arena.execute([&] {
      tbb::parallel_for(std::size_t{0}, batch.size(),
                        [&](std::size_t i) { encoders.local().encode(batch[i], grid_, level_); });
    });
    advance(triangles);
    for (const Fragment& fragment : batch) {
      if (fragment.encoded.empty()) continue;
      if (fragment.encoded.size() > std::numeric_limits<std::uint32_t>::max())
        throw Error("a part of the mesh has more than 4 GiB, which neuroglancer cannot read");
      write(fragment.encoded);
      encoded.push_back(
          {fragment.key, static_cast<std::uint32_t>(fragment.encoded.size()), fragment.halves});
    }
  }
  sorted_.release();
  return encoded;
}

}  // namespace isobrick

#include "io/meshes/levels/level_fragments.h"
#include "core/thread_count.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <string>

#include <isobrick/error.h>
#include "core/cancel.h"
#include "io/meshes/levels/lattice_cut.h"

namespace isobrick::inline v0 {
namespace {

/// The triangles of a fragment, and what they become.
struct Fragment {
  EncodedFragment entry;
  LoadedTriangles loaded;
  std::string encoded;
};

/// What a thread keeps from fragment to fragment.
struct Encoder {
  LatticeCut cut;
  FragmentWelder welder;

  Encoder(const ChunkGrid& grid, int level, bool has_halves) : cut(grid, level, has_halves) {}

  void encode(Fragment& fragment, const FragmentPlace& place, const LevelWriter& writer);
};

CutTriangle on_lattice(const LoadedTriangles& loaded, std::size_t i, const FragmentPlace& place) {
  CutTriangle triangle;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    triangle[corner].at = place.grid.quantize(loaded.positions[i][corner], place.level);
    if (!loaded.normals.empty()) triangle[corner].normal = loaded.normals[i][corner];
  }
  return triangle;
}

void Encoder::encode(Fragment& fragment, const FragmentPlace& place, const LevelWriter& writer) {
  const std::uint32_t halves = cut.halves();
  EncodedFragment& entry = fragment.entry;
  entry.lo.fill(std::numeric_limits<std::uint16_t>::max());
  const std::size_t triangles = fragment.loaded.positions.size();
  welder.begin(triangles, !fragment.loaded.normals.empty());
  for (std::size_t i = 0; i < triangles; ++i)
    cut.for_each_piece(
        on_lattice(fragment.loaded, i, place), [&](const CutTriangle& piece, const GridCell& cell) {
          unsigned half = 0;
          for (std::size_t axis = 0; axis < 3; ++axis) {
            if (cell[axis] / halves != place.cell[axis]) return;
            half |= (cell[axis] % halves) << axis;
          }
          entry.halves = static_cast<std::uint8_t>(entry.halves | 1U << half);
          std::array<FragmentPoint, 3> points;
          for (std::size_t corner = 0; corner < 3; ++corner)
            for (std::size_t axis = 0; axis < 3; ++axis) {
              const auto step = static_cast<std::uint16_t>(
                  piece[corner].at[axis] - std::int64_t{place.cell[axis]} * ChunkGrid::kSteps);
              points[corner][axis] = step;
              entry.lo[axis] = std::min(entry.lo[axis], step);
              entry.hi[axis] = std::max(entry.hi[axis], step);
            }
          welder.add(points, {piece[0].normal, piece[1].normal, piece[2].normal});
        });
  fragment.encoded = writer.encode(welder.mesh(), place);
  fragment.loaded = {};
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

template <class Number>
LevelFragments<Number>::LevelFragments(MeshSpool<Number>& mesh, const ChunkGrid& grid, int level,
                                       const FragmentWork& work)
    : mesh_(mesh), grid_(grid), level_(level), work_(work), sorted_(work.place, work.memory) {
  for_each_touched([](const TriangleOf<Number>&, Run& run) { ++run.end; });
}

template <class Number>
LatticeTriangle LevelFragments<Number>::on_lattice(const TriangleOf<Number>& triangle) {
  LatticeTriangle t;
  for (std::size_t corner = 0; corner < 3; ++corner)
    t[corner] = grid_.quantize(mesh_.positions()[triangle[corner]], level_);
  return t;
}

template <class Number>
void LevelFragments<Number>::advance(std::uint64_t triangles) const {
  if (cancel_requested()) throw Cancelled("the operation was cancelled");
  work_.progress->advance(triangles * sizeof(Triangle));
}

template <class Number>
template <class F>
void LevelFragments<Number>::for_each_touched(F&& f) {
  const LatticeCut cut(grid_, level_);
  GridCell last{};
  Run* run_of_last = nullptr;  // mostly it is the next one's, too
  mesh_.triangles().for_each_run([&](std::span<const TriangleOf<Number>> triangles, std::uint64_t) {
    advance(triangles.size());
    for (const auto& t : triangles)
      cut.for_each_fragment(on_lattice(t), [&](const GridCell& cell) {
        if (!run_of_last || cell != last) run_of_last = &runs_[z_order_key(cell)];
        last = cell;
        f(t, *run_of_last);
      });
  });
}

template <class Number>
std::uint64_t LevelFragments<Number>::largest() const {
  std::uint64_t most = 0;
  for (const auto& [key, run] : runs_) most = std::max(most, run.size());
  return most;
}

template <class Number>
void LevelFragments<Number>::sort() {
  std::uint64_t end = 0;
  for (auto& [key, run] : runs_) {
    const std::uint64_t count = run.size();
    run = {end, end};
    end += count;
  }
  sorted_.resize(end);
  for_each_touched([&](const TriangleOf<Number>& t, Run& run) { sorted_.edit(run.end++) = t; });
}

template <class Number>
LoadedTriangles LevelFragments<Number>::load(const Run& run) {
  LoadedTriangles loaded;
  const bool has_normals = mesh_.has_normals();
  loaded.positions.reserve(static_cast<std::size_t>(run.size()));
  if (has_normals) loaded.normals.reserve(static_cast<std::size_t>(run.size()));
  sorted_.for_each_run(run.begin, run.end,
                       [&](std::span<const TriangleOf<Number>> part, std::uint64_t) {
                         for (const auto& t : part) {
                           auto& corners = loaded.positions.emplace_back();
                           for (std::size_t corner = 0; corner < 3; ++corner)
                             corners[corner] = mesh_.positions()[t[corner]];
                           if (!has_normals) continue;
                           auto& normals = loaded.normals.emplace_back();
                           for (std::size_t corner = 0; corner < 3; ++corner)
                             normals[corner] = mesh_.normals()[t[corner]];
                         }
                       });
  return loaded;
}

template <class Number>
std::vector<EncodedFragment> LevelFragments<Number>::encode(LevelWriter& writer) {
  sort();
  tbb::task_arena arena(thread_count(work_.threads));
  tbb::enumerable_thread_specific<Encoder> encoders(
      [&] { return Encoder(grid_, level_, writer.needs().halves); });
  std::vector<EncodedFragment> encoded;
  std::vector<Fragment> batch;
  const auto place_of = [&](const Fragment& fragment) {
    return FragmentPlace{grid_, level_, cell_of_key(fragment.entry.key)};
  };
  for (auto at = runs_.cbegin(); at != runs_.cend();) {
    batch.clear();
    std::uint64_t triangles = 0;
    do {
      triangles += at->second.size();
      batch.push_back({.entry = {.key = at->first}, .loaded = load(at->second)});
    } while (++at != runs_.cend() && triangles + at->second.size() <= work_.triangles_at_once);
    arena.execute([&] {
      tbb::parallel_for(std::size_t{0}, batch.size(), [&](std::size_t i) {
        encoders.local().encode(batch[i], place_of(batch[i]), writer);
      });
    });
    advance(triangles);
    for (Fragment& fragment : batch) {
      if (fragment.encoded.empty()) continue;
      if (fragment.encoded.size() > std::numeric_limits<std::uint32_t>::max())
        throw Error("a part of the mesh has more than 4 GiB, which no viewer can read");
      fragment.entry.bytes = static_cast<std::uint32_t>(fragment.encoded.size());
      writer.write(place_of(fragment), fragment.encoded);
      encoded.push_back(fragment.entry);
    }
  }
  sorted_.release();
  return encoded;
}

template class LevelFragments<std::uint32_t>;
template class LevelFragments<std::uint64_t>;

}  // namespace isobrick

#include "surface/sample_vertices.h"

#include <algorithm>
#include <bit>
#include <optional>

#include "core/morton.h"
#include "core/threshold.h"
#include "surface/cap.h"
#include "surface/coincident_vertices.h"
#include "surface/patched_cells.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kLastSample = kTileSamples - 1;

/// The first tile in Morton order, as SampleVertex::owner, with a cell at sample `p` for which
/// has_vertex(cell, corner) holds, where `corner` of the cell is the sample; the tile itself has
/// one. All in coordinates of the tile.
template <class HasVertex>
std::uint8_t first_tile_at(Int3 tile, Int3 p, const HasVertex& has_vertex) {
  const auto side = [](Index cell) -> Index { return cell < 0 ? -1 : cell < kTileEdge ? 0 : 1; };
  std::uint8_t owner = SampleVertex::kOwn;
  std::uint64_t first = morton_encode(tile);
  for (int corner = 0; corner < 8; ++corner) {
    const Int3 cell = p - Int3{corner & 1, corner >> 1 & 1, corner >> 2};
    const std::uint8_t of = neighbour_of({side(cell.x), side(cell.y), side(cell.z)});
    const Int3 other = tile + offset_of(of);
    if (of == SampleVertex::kOwn || of == owner || other.x < 0 || other.y < 0 || other.z < 0)
      continue;
    const std::uint64_t code = morton_encode(other);
    if (code < first && has_vertex(cell, corner)) {
      first = code;
      owner = of;
    }
  }
  return owner;
}

/// Whether other tiles have the sample at a place as well.
bool is_shared(const KernelContext& context, const TileShape& shape, std::uint32_t place) {
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<int>(place >> 6 * axis & 63);
    if (i == 0 && !shape.first[axis]) return true;
    if (i == kLastSample && context.border.hi[axis] - 1 > shape.origin[axis] + kLastSample)
      return true;
  }
  return false;
}

/// Tells which triangles the cells around a sample have there. That follows from the samples around
/// it alone, so all tiles find the same.
template <class T>
class TrianglesAtSample {
 public:
  TrianglesAtSample(const KernelContext& context, const TileState& tile)
      : context_(context),
        tile_(tile),
        samples_(reinterpret_cast<const T*>(tile.samples.data())),
        threshold_(Threshold<T>(context.isovalue).value),
        coincident_(tile.coincident ? coincident_value<T>(context.isovalue) : std::nullopt),
        has_cap_(tile.cap && tile.cap->near) {}

  /// The neighbour that makes the vertex on a used sample.
  std::uint8_t owner(Int3 p) const {
    return first_tile_at(tile_.work.tile, p, [&](Int3 cell, int corner) {
      return (coincident_ && surface_has(cell, corner)) || (has_cap_ && cap_has(cell, corner));
    });
  }

  /// Whether triangles of the surface have a corner on a used sample.
  bool of_surface(Int3 p) const {
    if (!coincident_ || !has_cap_) return coincident_.has_value();
    for (int corner = 0; corner < 8; ++corner)
      if (surface_has(p - Int3{corner & 1, corner >> 1 & 1, corner >> 2}, corner)) return true;
    return false;
  }

 private:
  /// A cell's corners, as bits.
  struct Corners {
    std::uint32_t inside = 0, at = 0;
    bool missing = false;
  };
  Corners corners_of(Int3 cell) const {
    const int x = static_cast<int>(cell.x), y = static_cast<int>(cell.y),
              z = static_cast<int>(cell.z);
    Corners corners;
    for (int c = 0; c < 8; ++c) {
      const T v = samples_[TileLayout::offset(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2))];
      corners.missing |= v != v;
      corners.inside |= static_cast<std::uint32_t>(v >= threshold_) << c;
      corners.at |= static_cast<std::uint32_t>(v == coincident_) << c;
    }
    return corners;
  }

  bool surface_has(Int3 cell, int corner) const {
    const Int3 lo = tile_.shape.origin + cell;
    if (!context_.roi.contains(lo) || !context_.roi.contains(lo + Int3{1, 1, 1})) return false;
    const Corners corners = corners_of(cell);
    if (corners.missing) return false;
    bool found = false;
    const auto look_at = [&](int a, int b, int c) {
      found = found || a == corner || b == corner || c == corner;
    };
    if (!context_.trilinear) {
      coincident::for_each_kept(kCaseTables, corners.inside, corners.at, look_at);
      return found;
    }
    const TopologyTables& tables = topology_tables();
    const CellValues<T> values(samples_, context_.isovalue, static_cast<int>(cell.x),
                               static_cast<int>(cell.y), static_cast<int>(cell.z));
    const CellPatch& patch =
        tables.patches[cell_topology::patch_of(tables, static_cast<int>(corners.inside), values.d)];
    coincident::for_each_kept(tables.corners + patch.first, patch.triangles, corners.at, look_at);
    return found;
  }

  bool cap_has(Int3 cell, int corner) const {
    const ExistingCells& cells = tile_.cap->cells;
    if (!exists(cells, cell.x, cell.y, cell.z)) return false;
    for (int axis = 0; axis < 3; ++axis) {
      const int face = 2 * axis + (corner >> axis & 1);
      if (!is_border_face(cells, cell, face)) continue;
      if (!coincident_) return true;  // the sample is inside, and so a corner of the polygon
      Corners corners = corners_of(cell);
      if (context_.inside == Inside::below) corners.inside ^= 0xff;
      const std::uint32_t polygon =
          polygon_of<T>(context_, tile_, static_cast<int>(cell.x), static_cast<int>(cell.y),
                        static_cast<int>(cell.z), face, corners.inside);
      bool found = false;
      for_each_cap_triangle(
          static_cast<std::uint32_t>(face), polygon, corners.at,
          [&](int a, int b, int c) { found = found || a == corner || b == corner || c == corner; });
      if (found) return true;
    }
    return false;
  }

  const KernelContext& context_;
  const TileState& tile_;
  const T* samples_;
  T threshold_;
  std::optional<T> coincident_;
  bool has_cap_;
};

template <class T>
void list_used(const KernelContext& context, bool unwelded, TileState& tile) {
  SampleVertices& on_samples = *tile.on_samples;
  const TrianglesAtSample<T> triangles(context, tile);
  for (int row = 0; row < kTileRows; ++row) {
    on_samples.first[row] = static_cast<std::uint32_t>(on_samples.vertices.size());
    for (std::uint64_t word = on_samples.used[row]; word; word &= word - 1) {
      const int x = std::countr_zero(word), y = row % kTileSamples, z = row / kTileSamples;
      SampleVertex vertex{static_cast<std::uint32_t>(x | y << 6 | z << 12), 0, SampleVertex::kOwn,
                          false};
      if (!unwelded && is_shared(context, tile.shape, vertex.place))
        vertex.owner = triangles.owner({x, y, z});
      if (vertex.owner == SampleVertex::kOwn) {
        vertex.number = tile.vertices + on_samples.own++;
        vertex.of_surface = triangles.of_surface({x, y, z});
      }
      on_samples.vertices.resize(on_samples.vertices.size() + 1);
      on_samples.vertices[on_samples.vertices.size() - 1] = vertex;
    }
  }
}

}  // namespace

void list_sample_vertices(ScalarType type, const KernelContext& context, bool unwelded,
                          TileState& tile) {
  visit_scalar(type,
               [&](auto tag) { list_used<typename decltype(tag)::type>(context, unwelded, tile); });
  tile.vertices += tile.on_samples->own;
}

void publish_sample_vertices(const KernelContext& context, TileState& tile) {
  const auto for_each_shared = [&](auto&& f) {
    for (const SampleVertex& vertex : tile.on_samples->vertices)
      if (vertex.owner == SampleVertex::kOwn && is_shared(context, tile.shape, vertex.place))
        f(vertex);
  };
  std::size_t count = 0;
  for_each_shared([&](const SampleVertex&) { ++count; });
  PodBuffer<SharedSample>& published = tile.boundary->on_samples;
  published.clear();
  published.reserve(count);  // no more than that: boundaries are what a budget counts
  for_each_shared([&](const SampleVertex& vertex) {
    published.resize(published.size() + 1);
    published[published.size() - 1] = {vertex.place, vertex.number};
  });
}

void adopt_sample_vertices(TileState& tile, const BoundaryMap& map) {
  for (SampleVertex& vertex : tile.on_samples->vertices) {
    if (vertex.owner == SampleVertex::kOwn) {
      vertex.number += tile.number_base;
      continue;
    }
    const Int3 offset = offset_of(vertex.owner);
    const TileBoundary& from = *map.find(tile.work.tile + offset);
    const auto along = [&](int axis) {
      return static_cast<std::uint32_t>((vertex.place >> 6 * axis & 63) - kTileEdge * offset[axis]);
    };
    const std::uint32_t place = along(0) | along(1) << 6 | along(2) << 12;
    const PodBuffer<SharedSample>& samples = from.on_samples;
    const SharedSample* found = std::lower_bound(
        samples.begin(), samples.end(), place,
        [](const SharedSample& sample, std::uint32_t p) { return sample.place < p; });
    vertex.number = from.base + found->number;
  }
}

}  // namespace isobrick

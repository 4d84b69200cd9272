#include "surface/labels/label_tile.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "surface/labels/sheet_tables.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kEdge = LabelWindow::kEdge;
/// Of the cells behind the last of the tile.
constexpr int kForeignPlane = LabelWindow::kBefore + static_cast<int>(kTileEdge);

/// From one place to the next along each axis.
constexpr std::array<int, 3> kStep{1, kEdge, kEdge* kEdge};

constexpr int corner_at(int corner) {
  return (corner & 1) + kEdge * ((corner >> 1 & 1) + kEdge * (corner >> 2));
}

/// The corner at the lower end of an edge.
constexpr int low_corner(int edge) {
  const int first = edge & 1, second = edge >> 1 & 1;
  constexpr int bits[3][2] = {{2, 4}, {1, 4}, {1, 2}};
  return first * bits[edge / 4][0] + second * bits[edge / 4][1];
}

/// The point of a cell whose edges with different ends are those of a mask, from its first corner.
struct CellPoints {
  std::array<Vec3f, 4096> of;

  CellPoints() {
    for (std::size_t mask = 0; mask < of.size(); ++mask) {
      Vec3f sum;
      for (int edge = 0; edge < 12; ++edge) {
        if (!(mask >> edge & 1)) continue;
        const int corner = low_corner(edge);
        Vec3f middle{static_cast<float>(corner & 1), static_cast<float>(corner >> 1 & 1),
                     static_cast<float>(corner >> 2)};
        middle[edge / 4] = 0.5f;
        sum = sum + middle;
      }
      const auto count = static_cast<float>(std::max(1, std::popcount(mask)));
      of[mask] = {sum.x / count, sum.y / count, sum.z / count};
    }
  }
};

const CellPoints& cell_points() {
  static const CellPoints points;
  return points;
}

Vec3f point_in_window(LabelVertex v) {
  const auto place = LabelWindow::place(cell_of(v));
  return Vec3f{static_cast<float>(place[0]), static_cast<float>(place[1]),
               static_cast<float>(place[2])} +
         cell_points().of[static_cast<std::size_t>(edges_of(v))];
}

float squared_distance(Vec3f a, Vec3f b) {
  const Vec3f d = a - b;
  return dot(d, d);
}

/// The label that a sample is. Throws where it is no whole number.
template <class T>
std::int64_t label_of(T sample) {
  if constexpr (std::is_floating_point_v<T>) {
    constexpr T limit = T{1} / std::numeric_limits<T>::epsilon() * 2;
    if (!(std::abs(sample) <= limit) || sample != std::trunc(sample))
      throw Error(fmt::format(
          "a sample is {}, and labels are whole numbers of at most {:.0f}: this is no label image",
          sample, limit));
  }
  return static_cast<std::int64_t>(sample);
}

template <class T>
bool has_label(T sample) {
  return sample == sample;
}

/// Bits x of the samples of a row that differ from those at `other`.
template <class Id>
std::uint64_t different(const Id* row, const Id* other, int count) {
  if (std::memcmp(row, other, static_cast<std::size_t>(count) * sizeof(Id)) == 0) return 0;
  std::uint64_t bits = 0;
  for (int x = 0; x < count; ++x) bits |= static_cast<std::uint64_t>(row[x] != other[x]) << x;
  return bits;
}

/// Bits lo … hi − 1.
constexpr std::uint64_t bits_between(int lo, int hi) {
  return hi <= lo ? 0 : (std::uint64_t{1} << hi) - (std::uint64_t{1} << lo);
}

/// A vertex of a cell behind the tile, as its owner names it.
ForeignVertex foreign_vertex(int cell, std::uint32_t sheet) {
  std::uint32_t neighbour = 0;
  const auto place = LabelWindow::place(cell);
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (place[axis] >= kForeignPlane) {
      neighbour |= 1U << axis;
      cell -= static_cast<int>(kTileEdge) * kStep[axis];
    }
  return {neighbour | static_cast<std::uint32_t>(cell) << 3 | sheet << 19};
}

}  // namespace

Vec3d label_point(Int3 tile, LabelVertex v) {
  const Int3 origin = LabelWindow::origin(tile);
  const auto place = LabelWindow::place(cell_of(v));
  const Vec3f in_cell = cell_points().of[static_cast<std::size_t>(edges_of(v))];
  Vec3d point;
  for (int axis = 0; axis < 3; ++axis)
    point[axis] = static_cast<double>(origin[axis] + place[static_cast<std::size_t>(axis)]) +
                  static_cast<double>(in_cell[axis]);
  return point;
}

LabelTile::LabelTile()
    : ids_(LabelWindow::kVolume),
      cell_edges_(LabelWindow::kVolume),
      first_entry_(LabelWindow::kVolume) {
  for (std::vector<std::uint64_t>& rows : differs_) rows.resize(kEdge * kEdge);
}

std::uint64_t LabelTile::max_bytes(ScalarType type) {
  constexpr std::uint64_t cells = std::uint64_t{kTileEdge + 2} * (kTileEdge + 2) * (kTileEdge + 2);
  constexpr std::uint64_t per_cell =
      8 * (sizeof(Entry) + sizeof(Of<LabelVertex>) + sizeof(LabelVertex)) +
      6 * (sizeof(Of<LabelQuad>) + sizeof(LabelQuad));
  constexpr std::uint64_t per_sample = sizeof(Id) + sizeof(std::uint16_t) + sizeof(std::uint32_t) +
                                       sizeof(std::int64_t) + 2 * sizeof(Counts) +
                                       sizeof(LabelPiece) + 4 * sizeof(std::uint64_t);
  // Vectors that grow hold twice as much as they need at most.
  return 2 * cells * per_cell + LabelWindow::kVolume * (size_of(type) + 2 * per_sample);
}

void LabelTile::read(const TileSamples& samples, ScalarType type, Int3 tile, Box3 roi) {
  tile_ = tile;
  const Int3 origin = LabelWindow::origin(tile);
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    // The first tile owns the cells before the first sample, too.
    const Index first = tile[axis] == 0 ? -1 : tile[axis] * kTileEdge;
    lo_[i] = static_cast<int>(std::max(first, roi.lo[axis] - 1) - origin[axis]);
    hi_[i] = static_cast<int>(std::min((tile[axis] + 1) * kTileEdge, roi.hi[axis]) - origin[axis]);
  }
  samples_.resize(LabelWindow::kVolume * size_of(type));
  constexpr int before = LabelWindow::kBefore;
  samples.gather({tile, 0xff}, before,
                 {samples_.data(), LabelWindow::at(before, before, before), kStep[1], kStep[2]});
  labels_.assign(1, 0);
  id_of_ = FlatMap<Id>();
  visit_scalar(type, [&](auto tag) { number_labels<typename decltype(tag)::type>(roi); });
  chosen_.assign(labels_.size(), 0);
  find_edges();
}

LabelTile::Id LabelTile::id_of(std::int64_t label) {
  // The map's free key is that of −1, which is looked up as the smallest number instead.
  const auto key = label == -1 ? std::uint64_t{1} << 63 : static_cast<std::uint64_t>(label);
  const auto [id, is_new] = id_of_.insert(key);
  if (is_new) {
    id = static_cast<Id>(labels_.size());
    labels_.push_back(label);
  }
  return id;
}

/// Replaces the samples of the region by numbers of their labels, everything else by kOutside.
template <class T>
void LabelTile::number_labels(Box3 roi) {
  const T* samples = reinterpret_cast<const T*>(samples_.data());
  const Int3 origin = LabelWindow::origin(tile_);
  const Int3 lo = max(roi.lo - origin, {0, 0, 0}), hi = min(roi.hi - origin, {kEdge, kEdge, kEdge});
  std::fill(ids_.begin(), ids_.end(), kOutside);
  T last{};
  Id last_id = kOutside;
  for (Index z = lo.z; z < hi.z; ++z)
    for (Index y = lo.y; y < hi.y; ++y) {
      const auto row = static_cast<std::size_t>(kEdge * (y + kEdge * z));
      for (Index x = lo.x; x < hi.x; ++x) {
        const std::size_t at = row + static_cast<std::size_t>(x);
        const T sample = samples[at];
        if (!has_label(sample)) continue;
        if (sample != last || last_id == kOutside) {
          last_id = id_of(label_of(sample));
          last = sample;
        }
        ids_[at] = last_id;
      }
    }
}

void LabelTile::find_edges() {
  for (int z = 0; z < kEdge; ++z)
    for (int y = 0; y < kEdge; ++y) {
      const auto row = static_cast<std::size_t>(y + kEdge * z);
      const Id* ids = ids_.data() + LabelWindow::at(0, y, z);
      differs_[0][row] = different(ids, ids + kStep[0], kEdge - 1);
      differs_[1][row] = y + 1 < kEdge ? different(ids, ids + kStep[1], kEdge) : 0;
      differs_[2][row] = z + 1 < kEdge ? different(ids, ids + kStep[2], kEdge) : 0;
    }
}

void LabelTile::visit_cells() {
  entries_.clear();
  owned_.clear();
  foreign_.clear();
  counts_.assign(labels_.size(), {});
  const auto& [along_x, along_y, along_z] = differs_;
  const std::uint64_t wanted = bits_between(lo_[0], std::min(hi_[0], kForeignPlane) + 1);
  for (int z = lo_[2]; z <= hi_[2]; ++z)
    for (int y = lo_[1]; y <= hi_[1]; ++y) {
      const auto row = static_cast<std::size_t>(y + kEdge * z);
      const std::uint64_t sides =
          along_y[row] | along_y[row + kEdge] | along_z[row] | along_z[row + 1];
      std::uint64_t cells = (along_x[row] | along_x[row + 1] | along_x[row + kEdge] |
                             along_x[row + kEdge + 1] | sides | sides >> 1) &
                            wanted;
      for (; cells; cells &= cells - 1) visit_cell(std::countr_zero(cells), y, z);
    }
}

/// Gives the labels of a cell their vertices.
void LabelTile::visit_cell(int x, int y, int z) {
  const int cell = LabelWindow::at(x, y, z);
  std::array<Id, 8> ids;
  for (int corner = 0; corner < 8; ++corner)
    ids[static_cast<std::size_t>(corner)] =
        ids_[static_cast<std::size_t>(cell + corner_at(corner))];
  int edges = 0;
  for (int edge = 0; edge < 12; ++edge) {
    const int low = low_corner(edge), high = low | 1 << edge / 4;
    edges |= (ids[static_cast<std::size_t>(low)] != ids[static_cast<std::size_t>(high)]) << edge;
  }
  first_entry_[static_cast<std::size_t>(cell)] = static_cast<std::uint32_t>(entries_.size());
  cell_edges_[static_cast<std::size_t>(cell)] = static_cast<std::uint16_t>(edges);
  const bool is_foreign = x >= kForeignPlane || y >= kForeignPlane || z >= kForeignPlane;
  unsigned seen = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Id id = ids[static_cast<std::size_t>(corner)];
    if (seen >> corner & 1) continue;
    unsigned corners = 0;
    for (int other = corner; other < 8; ++other)
      corners |= static_cast<unsigned>(ids[static_cast<std::size_t>(other)] == id) << other;
    seen |= corners;
    if (chosen_[id]) add_vertices(id, static_cast<std::uint8_t>(corners), cell, is_foreign);
  }
}

std::uint8_t LabelTile::corners_with(Id id, int cell) const {
  unsigned corners = 0;
  for (int corner = 0; corner < 8; ++corner)
    corners |= static_cast<unsigned>(ids_[static_cast<std::size_t>(cell + corner_at(corner))] == id)
               << corner;
  return static_cast<std::uint8_t>(corners);
}

/// Whether sheets pass the pinched face twice on both of its sides.
bool LabelTile::is_split(Id id, std::uint8_t corners, int cell) const {
  const int face = kSheetTables.pinched_face[corners];
  if (face == kNoFace) return false;
  const int step = kStep[static_cast<std::size_t>(face / 2)];
  const int other = face % 2 ? cell + step : cell - step;
  return kSheetTables.pinched_face[corners_with(id, other)] == (face ^ 1);
}

void LabelTile::add_vertices(Id id, std::uint8_t corners, int cell, bool is_foreign) {
  Entry entry{id, corners, is_split(id, corners, cell), kUnused};
  if (!is_foreign) {
    entry.first_vertex = counts_[id].vertices;
    const int count = (entry.is_split ? kSheetTables.split : kSheetTables.sheets)[corners].count;
    counts_[id].vertices += static_cast<std::uint32_t>(count);
    for (int sheet = 0; sheet < count; ++sheet) owned_.push_back({id, vertex_in(cell)});
  }
  entries_.push_back(entry);
}

void LabelTile::visit_edges() {
  quads_.clear();
  // Of an edge, the first of the four cells around it is the one that decides whose it is.
  for (int axis = 0; axis < 3; ++axis) {
    const int dx = axis != 0, dy = axis != 1, dz = axis != 2;
    const std::uint64_t wanted = bits_between(lo_[0] + dx, hi_[0] + dx);
    for (int z = lo_[2] + dz; z < hi_[2] + dz; ++z)
      for (int y = lo_[1] + dy; y < hi_[1] + dy; ++y) {
        std::uint64_t bits =
            differs_[static_cast<std::size_t>(axis)][static_cast<std::size_t>(y + kEdge * z)] &
            wanted;
        for (; bits; bits &= bits - 1) visit_edge(axis, std::countr_zero(bits), y, z);
      }
  }
}

/// Makes the quads of the edge from sample (x, y, z) along an axis, one for each label.
void LabelTile::visit_edge(int axis, int x, int y, int z) {
  const int low = LabelWindow::at(x, y, z);
  const int next = kStep[static_cast<std::size_t>((axis + 1) % 3)];
  const int after = kStep[static_cast<std::size_t>((axis + 2) % 3)];
  // Counter-clockwise seen from the upper end.
  const std::array<int, 4> cells{low - next - after, low - after, low, low - next};
  const Id a = ids_[static_cast<std::size_t>(low)];
  const Id b = ids_[static_cast<std::size_t>(low + kStep[static_cast<std::size_t>(axis)])];
  if (chosen_[a]) add_quad(a, axis, cells, false);
  if (chosen_[b]) add_quad(b, axis, cells, true);
}

/// `is_upper`: the label is that of the edge's upper end.
void LabelTile::add_quad(Id id, int axis, const std::array<int, 4>& cells, bool is_upper) {
  // The edge in each of the cells: whether it lies above along the next axis and the one after.
  constexpr int above_next[4] = {1, 0, 0, 1}, above_after[4] = {1, 1, 0, 0};
  LabelQuad quad;
  std::array<Vec3f, 4> points;
  for (std::size_t i = 0; i < 4; ++i) {
    // Edges are numbered by the other two axes in their order x, y, z; along y, z comes first here.
    const int first = axis == 1 ? above_after[i] : above_next[i];
    const int second = axis == 1 ? above_next[i] : above_after[i];
    quad[i] = vertex_of(id, cells[i], 4 * axis + first + 2 * second);
    points[i] = point_in_window(vertex_in(cells[i]));
  }
  if (squared_distance(points[1], points[3]) < squared_distance(points[0], points[2]))
    quad = {quad[1], quad[2], quad[3], quad[0]};
  if (is_upper) std::swap(quad[1], quad[3]);
  quads_.push_back({id, quad});
  ++counts_[id].quads;
}

/// The vertex of the label's sheet that an edge of a cell belongs to.
std::uint32_t LabelTile::vertex_of(Id id, int cell, int edge) {
  std::size_t i = first_entry_[static_cast<std::size_t>(cell)];
  while (entries_[i].id != id) ++i;
  Entry& entry = entries_[i];
  const CellSheets& sheets =
      (entry.is_split ? kSheetTables.split : kSheetTables.sheets)[entry.corners];
  if (entry.first_vertex == kUnused) {
    entry.first_vertex = kForeign | counts_[id].foreign;
    counts_[id].foreign += sheets.count;
    for (std::uint32_t sheet = 0; sheet < sheets.count; ++sheet)
      foreign_.push_back({id, foreign_vertex(cell, sheet)});
  }
  return entry.first_vertex + sheets.of_edge[static_cast<std::size_t>(edge)];
}

std::span<const LabelPiece> LabelTile::make_pieces() {
  visit_cells();
  visit_edges();
  sort_by_label();
  return pieces_;
}

void LabelTile::sort_by_label() {
  pieces_.clear();
  Counts total;
  starts_.resize(counts_.size());
  sorted_vertices_.resize(owned_.size());
  sorted_foreign_.resize(foreign_.size());
  sorted_quads_.resize(quads_.size());
  for (std::size_t id = 0; id < counts_.size(); ++id) {
    const Counts& count = counts_[id];
    starts_[id] = total;
    if (count.vertices + count.quads > 0)
      pieces_.push_back({labels_[id],
                         std::span(sorted_vertices_).subspan(total.vertices, count.vertices),
                         std::span(sorted_foreign_).subspan(total.foreign, count.foreign),
                         std::span(sorted_quads_).subspan(total.quads, count.quads)});
    total.vertices += count.vertices;
    total.foreign += count.foreign;
    total.quads += count.quads;
  }
  for (const auto& [id, vertex] : owned_) sorted_vertices_[starts_[id].vertices++] = vertex;
  for (const auto& [id, vertex] : foreign_) sorted_foreign_[starts_[id].foreign++] = vertex;
  for (auto& [id, quad] : quads_) {
    for (std::uint32_t& vertex : quad)
      if (vertex & kForeign) vertex = (vertex & ~kForeign) + counts_[id].vertices;
    sorted_quads_[starts_[id].quads++] = quad;
  }
}

}  // namespace isobrick

#include "surface/labels/label_tile.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "surface/labels/label_value.h"
#include "surface/labels/sheet_tables.h"

namespace isobrick::inline v0 {
namespace {

float squared_distance(Vec3f a, Vec3f b) {
  const Vec3f d = a - b;
  return dot(d, d);
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

/// The faces of a cell whose corners have three labels or more, as bits.
template <class Id>
int junctions_of(const std::array<Id, 8>& ids) {
  int junctions = 0;
  for (int face = 0; face < 6; ++face) {
    const auto id = [&](int i) {
      return ids[static_cast<std::size_t>(case_rule::kFaces[face][i % 4])];
    };
    int changes = 0;  // around the face; two labels change twice, or four times across a diagonal
    for (int i = 0; i < 4; ++i) changes += id(i) != id(i + 1);
    const bool is_checkered = id(0) == id(2) && id(1) == id(3);
    junctions |= (changes > 2 && !is_checkered) << face;
  }
  return junctions;
}

const CellSheets& sheets_of(std::uint8_t corners, bool is_split) {
  return (is_split ? kSheetTables.split : kSheetTables.sheets)[corners];
}

}  // namespace

LabelTile::LabelTile(const LabelSmoothing& smoothing)
    : smoothing_(smoothing),
      window_(smoothing.reach()),
      ids_(window_.volume()),
      points_(window_.edge) {
  for (std::vector<std::uint64_t>& rows : differs_)
    rows.resize(static_cast<std::size_t>(window_.edge * window_.edge));
}

std::uint64_t LabelTile::max_bytes(ScalarType type, const LabelSmoothing& smoothing) {
  constexpr std::uint64_t cells = std::uint64_t{kTileEdge + 2} * (kTileEdge + 2) * (kTileEdge + 2);
  constexpr std::uint64_t per_cell =
      8 * (sizeof(Entry) + sizeof(Of<LabelVertex>) + sizeof(LabelVertex)) +
      6 * (sizeof(Of<LabelQuad>) + sizeof(LabelQuad));
  constexpr std::uint64_t per_sample = sizeof(Id) + sizeof(std::uint32_t);
  constexpr std::uint64_t per_label = sizeof(Label) + 2 * sizeof(Counts) + sizeof(LabelPiece) +
                                      2 * (sizeof(LabelKey) + sizeof(std::uint64_t));
  const LabelWindow window(smoothing.reach());
  const std::uint64_t labels =
      std::min<std::uint64_t>(window.volume(), std::numeric_limits<Id>::max());
  // Vectors that grow hold twice as much as they need at most.
  return 2 * cells * per_cell + window.volume() * (size_of(type) + 2 * per_sample) +
         2 * labels * per_label + LabelPoints::max_bytes(window.edge);
}

void LabelTile::read(const TileSamples& samples, ScalarType type, Int3 tile, Box3 roi) {
  tile_ = tile;
  const Int3 origin = window_.origin(tile);
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    // The first tile owns the cells before the first sample, too.
    const Index first = tile[axis] == 0 ? -1 : tile[axis] * kTileEdge;
    lo_[i] = static_cast<int>(std::max(first, roi.lo[axis] - 1) - origin[axis]);
    hi_[i] = static_cast<int>(std::min((tile[axis] + 1) * kTileEdge, roi.hi[axis]) - origin[axis]);
  }
  samples_.resize(window_.volume() * size_of(type));
  const int margin = window_.margin;
  samples.gather({tile, 0xff}, margin,
                 {samples_.data(), window_.at(margin, margin, margin), window_.steps()[1],
                  window_.steps()[2]});
  labels_.assign(1, 0);
  id_of_ = FlatMap<Id, LabelKey>();
  visit_sample(type, [&](auto tag) { number_labels<typename decltype(tag)::type>(roi); });
  chosen_.assign(labels_.size(), 0);
  find_edges();
  find_points();
}

LabelTile::Id LabelTile::id_of(const Label& label) {
  const auto [id, is_new] = id_of_.insert(label_key(label));
  if (is_new) {
    if (labels_.size() > std::numeric_limits<Id>::max())
      throw Error("more than 65,535 labels lie within 64 samples: this is no label image");
    id = static_cast<Id>(labels_.size());
    labels_.push_back(label);
  }
  return id;
}

/// Replaces the samples of the region by numbers of their labels, everything else by kOutside.
template <class T>
void LabelTile::number_labels(Box3 roi) {
  const T* samples = reinterpret_cast<const T*>(samples_.data());
  const Int3 origin = window_.origin(tile_), edge{window_.edge, window_.edge, window_.edge};
  const Int3 lo = max(roi.lo - origin, {0, 0, 0}), hi = min(roi.hi - origin, edge);
  std::fill(ids_.begin(), ids_.end(), kOutside);
  T last{};
  Id last_id = kOutside;
  for (Index z = lo.z; z < hi.z; ++z)
    for (Index y = lo.y; y < hi.y; ++y) {
      const auto row = static_cast<std::size_t>(edge.x * (y + edge.y * z));
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
  const int edge = window_.edge;
  const auto [x_step, y_step, z_step] = window_.steps();
  for (int z = 0; z < edge; ++z)
    for (int y = 0; y < edge; ++y) {
      const auto row = static_cast<std::size_t>(y + edge * z);
      const Id* ids = ids_.data() + window_.at(0, y, z);
      differs_[0][row] = different(ids, ids + x_step, edge - 1);
      differs_[1][row] = y + 1 < edge ? different(ids, ids + y_step, edge) : 0;
      differs_[2][row] = z + 1 < edge ? different(ids, ids + z_step, edge) : 0;
    }
}

/// The points of the tile's cells and of the layer of cells behind them, and of all cells that
/// smoothing takes into account.
void LabelTile::find_points() {
  const auto& [along_x, along_y, along_z] = differs_;
  const int edge = window_.edge, reach = smoothing_.reach();
  const auto first = [&](std::size_t axis) { return std::max(lo_[axis] - reach, 0); };
  const auto last = [&](std::size_t axis) { return std::min(hi_[axis] + reach, edge - 2); };
  const std::uint64_t in_row = bits_between(first(0), last(0) + 1);
  points_.clear();
  for (int z = first(2); z <= last(2); ++z)
    for (int y = first(1); y <= last(1); ++y) {
      const auto row = static_cast<std::size_t>(y + edge * z);
      const std::size_t behind = row + static_cast<std::size_t>(edge);
      const std::uint64_t sides = along_y[row] | along_y[behind] | along_z[row] | along_z[row + 1];
      std::uint64_t cells = (along_x[row] | along_x[row + 1] | along_x[behind] |
                             along_x[behind + 1] | sides | sides >> 1) &
                            in_row;
      for (; cells; cells &= cells - 1) add_point(window_.at(std::countr_zero(cells), y, z));
    }
  points_.smooth(smoothing_);
}

void LabelTile::add_point(int cell) {
  const std::array<Id, 8> ids = corner_ids(cell);
  int edges = 0;
  for (int e = 0; e < 12; ++e) {
    const auto low = static_cast<std::size_t>(low_corner(e));
    edges |= (ids[low] != ids[low | std::size_t{1} << e / 4]) << e;
  }
  points_.add(cell, edges, smoothing_.iterations > 0 ? junctions_of(ids) : 0);
}

std::array<LabelTile::Id, 8> LabelTile::corner_ids(int cell) const {
  const Id* first = ids_.data() + cell;
  const auto [x, y, z] = window_.steps();
  return {first[0], first[x],     first[y],     first[y + x],
          first[z], first[z + x], first[z + y], first[z + y + x]};
}

void LabelTile::visit_cells() {
  entries_.clear();
  owned_.clear();
  foreign_.clear();
  counts_.assign(labels_.size(), {});
  first_entry_.resize(points_.cells().size());
  for (std::uint32_t i = 0; i < points_.cells().size(); ++i) {
    const auto cell = static_cast<int>(points_.cells()[i]);
    const auto place = window_.place(cell);
    bool is_needed = true;
    for (std::size_t axis = 0; axis < 3; ++axis)
      is_needed = is_needed && place[axis] >= lo_[axis] && place[axis] <= hi_[axis];
    if (!is_needed) continue;
    first_entry_[i] = static_cast<std::uint32_t>(entries_.size());
    visit_cell(cell, place);
  }
}

/// Gives the labels of a cell their vertices.
void LabelTile::visit_cell(int cell, const std::array<int, 3>& place) {
  const std::array<Id, 8> ids = corner_ids(cell);
  const int behind = window_.margin + static_cast<int>(kTileEdge);
  const bool is_foreign = place[0] >= behind || place[1] >= behind || place[2] >= behind;
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
  const std::array<Id, 8> ids = corner_ids(cell);
  unsigned corners = 0;
  for (std::size_t corner = 0; corner < 8; ++corner)
    corners |= static_cast<unsigned>(ids[corner] == id) << corner;
  return static_cast<std::uint8_t>(corners);
}

/// Whether sheets pass the pinched face twice on both of its sides.
bool LabelTile::is_split(Id id, std::uint8_t corners, int cell) const {
  const int face = kSheetTables.pinched_face[corners];
  if (face == kNoFace) return false;
  const int step = window_.steps()[static_cast<std::size_t>(face / 2)];
  const int other = face % 2 ? cell + step : cell - step;
  return kSheetTables.pinched_face[corners_with(id, other)] == (face ^ 1);
}

/// The cell's number among the tile's.
std::uint32_t LabelTile::code_of(int cell) const {
  const auto place = window_.place(cell);
  const int reach = smoothing_.reach();
  return static_cast<std::uint32_t>(
      TileCells::at(place[0] - reach, place[1] - reach, place[2] - reach));
}

/// A vertex of a cell behind the tile, as its owner names it.
ForeignVertex LabelTile::foreign_vertex(int cell, std::uint32_t sheet) const {
  constexpr int tile = static_cast<int>(kTileEdge);
  auto place = TileCells::place(static_cast<int>(code_of(cell)));
  std::uint32_t neighbour = 0;
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (place[axis] >= TileCells::kBefore + tile) {
      neighbour |= 1U << axis;
      place[axis] -= tile;
    }
  const auto code = static_cast<std::uint32_t>(TileCells::at(place[0], place[1], place[2]));
  return {neighbour | code << 3 | sheet << 19};
}

void LabelTile::add_vertices(Id id, std::uint8_t corners, int cell, bool is_foreign) {
  Entry entry{id, corners, is_split(id, corners, cell), kUnused};
  if (!is_foreign) {
    entry.first_vertex = counts_[id].vertices;
    const int count = sheets_of(corners, entry.is_split).count;
    counts_[id].vertices += static_cast<std::uint32_t>(count);
    const LabelVertex vertex{code_of(cell), points_.in_cell(points_.index_of(cell))};
    for (int sheet = 0; sheet < count; ++sheet) owned_.push_back({id, vertex});
  }
  entries_.push_back(entry);
}

void LabelTile::visit_edges() {
  quads_.clear();
  // Of an edge, the first of the four cells around it decides whose it is.
  for (int axis = 0; axis < 3; ++axis) {
    const int dx = axis != 0, dy = axis != 1, dz = axis != 2;
    const std::uint64_t in_row = bits_between(lo_[0] + dx, hi_[0] + dx);
    for (int z = lo_[2] + dz; z < hi_[2] + dz; ++z)
      for (int y = lo_[1] + dy; y < hi_[1] + dy; ++y) {
        const auto row = static_cast<std::size_t>(y + window_.edge * z);
        std::uint64_t bits = differs_[static_cast<std::size_t>(axis)][row] & in_row;
        for (; bits; bits &= bits - 1) visit_edge(axis, std::countr_zero(bits), y, z);
      }
  }
}

/// Makes the quads of the edge from sample (x, y, z) along an axis, one for each label.
void LabelTile::visit_edge(int axis, int x, int y, int z) {
  const auto steps = window_.steps();
  const int low = window_.at(x, y, z);
  const int next = steps[static_cast<std::size_t>((axis + 1) % 3)];
  const int after = steps[static_cast<std::size_t>((axis + 2) % 3)];
  // Counter-clockwise seen from the upper end.
  const std::array<int, 4> cells{low - next - after, low - after, low, low - next};
  const Id a = ids_[static_cast<std::size_t>(low)];
  const Id b = ids_[static_cast<std::size_t>(low + steps[static_cast<std::size_t>(axis)])];
  if (chosen_[a]) add_quad(a, axis, cells, false);
  if (chosen_[b]) add_quad(b, axis, cells, true);
}

/// In samples, from the window's origin.
Vec3f LabelTile::point_of(int cell) const {
  const auto place = window_.place(cell);
  return Vec3f{static_cast<float>(place[0]), static_cast<float>(place[1]),
               static_cast<float>(place[2])} +
         points_.in_cell(points_.index_of(cell));
}

/// `is_upper`: the label is that of the edge's upper end.
void LabelTile::add_quad(Id id, int axis, const std::array<int, 4>& cells, bool is_upper) {
  // Whether the edge lies above in the cell, along the next axis and the one after it.
  constexpr int above_next[4] = {1, 0, 0, 1}, above_after[4] = {1, 1, 0, 0};
  LabelQuad quad;
  for (std::size_t i = 0; i < 4; ++i) {
    // Edges are numbered by the other two axes in the order x, y, z; after y comes z.
    const int first = axis == 1 ? above_after[i] : above_next[i];
    const int second = axis == 1 ? above_next[i] : above_after[i];
    quad[i] = vertex_of(id, cells[i], 4 * axis + first + 2 * second);
  }
  if (squared_distance(point_of(cells[1]), point_of(cells[3])) <
      squared_distance(point_of(cells[0]), point_of(cells[2])))
    quad = {quad[1], quad[2], quad[3], quad[0]};
  if (is_upper) std::swap(quad[1], quad[3]);
  quads_.push_back({id, quad});
  ++counts_[id].quads;
}

/// The vertex of the label's sheet that an edge of a cell belongs to.
std::uint32_t LabelTile::vertex_of(Id id, int cell, int edge) {
  std::size_t i = first_entry_[points_.index_of(cell)];
  while (entries_[i].id != id) ++i;
  Entry& entry = entries_[i];
  const CellSheets& sheets = sheets_of(entry.corners, entry.is_split);
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

#include "surface/grid_extractor.h"

#include <algorithm>
#include <bit>

#include "surface/case_tables.h"
#include "surface/grid_math.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::uint64_t below(int count) {
  return count >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1;
}

/// Which of `count` values pass, one bit each.
template <class F>
std::uint64_t bits_of(const float* values, int count, F&& pass) {
  std::uint64_t bits = 0;
  for (int i = 0; i < count; ++i) bits |= static_cast<std::uint64_t>(pass(values[i]) ? 1 : 0) << i;
  return bits;
}

template <class F>
void for_each_bit(std::uint64_t bits, F&& f) {
  for (; bits != 0; bits &= bits - 1) f(std::countr_zero(bits));
}

constexpr std::uint32_t bit(std::uint64_t bits, int at) {
  return static_cast<std::uint32_t>(bits >> at & 1);
}

}  // namespace

void GridExtractor::find_inside(const GridView& g) {
  const int count = g.n[1] * g.n[2], low = std::min(g.n[0], 64);
  rows_.resize(static_cast<std::size_t>(count));
  const auto inside = [](float v) { return v >= 0; };
  const auto number = [](float v) { return v == v; };
  for (int i = 0; i < count; ++i) {
    const float* values = g.at(0, i % g.n[1], i / g.n[1]);
    Row& row = rows_[static_cast<std::size_t>(i)];
    row.inside = {bits_of(values, low, inside), bits_of(values + low, g.n[0] - low, inside)};
    row.number = {~std::uint64_t{0}, 1};
    if (!g.may_have_nan) continue;
    row.number = {bits_of(values, low, number), bits_of(values + low, g.n[0] - low, number)};
  }
}

template <int axis>
void GridExtractor::add_vertices(const GridView& g, int y, int z, Bits active_edges, Mesh& out) {
  Plane& plane = planes_[static_cast<std::size_t>(z & 1)];
  std::uint32_t* numbers = plane.data() + (axis * kGridPoints + y) * kGridPoints;
  auto next = static_cast<std::uint32_t>(out.positions.size());
  const auto count = static_cast<std::size_t>(std::popcount(active_edges.low)) + active_edges.last;
  out.positions.resize(next + count);
  out.normals.resize(next + count);
  if (meets_coarser_) faces_.resize(next + count);
  const auto add = [&](int x) {
    const grid::Vertex vertex = grid::vertex_on<axis>(g, x, y, z);
    out.positions[next] = vertex.position;
    out.normals[next] = vertex.normal;
    if (meets_coarser_) faces_[next] = static_cast<std::uint8_t>(vertex.faces);
    numbers[x] = next++;
  };
  for_each_bit(active_edges.low, add);
  if (active_edges.last) add(64);
}

/// The vertices on the edges from the points of a row.
void GridExtractor::add_row(const GridView& g, int y, int z, Mesh& out) {
  const Row* row = rows_.data() + z * g.n[1] + y;
  const auto across = [&](const Row& other) {
    return Bits{(row->inside.low ^ other.inside.low) & row->number.low & other.number.low,
                (row->inside.last ^ other.inside.last) & row->number.last & other.number.last};
  };
  const auto next_point = [](Bits b) { return Bits{b.low >> 1 | b.last << 63, 0}; };
  const Row shifted{next_point(row->inside), next_point(row->number)};
  add_vertices<0>(g, y, z, {across(shifted).low & below(g.n[0] - 1), 0}, out);
  if (y + 1 < g.n[1]) add_vertices<1>(g, y, z, across(row[1]), out);
  if (z + 1 < g.n[2]) add_vertices<2>(g, y, z, across(row[g.n[1]]), out);
}

/// The triangles of the cells above a row of points.
void GridExtractor::add_cells(const GridView& g, int y, int z, Mesh& out) {
  const Row* first = rows_.data() + z * g.n[1] + y;
  const Row* rows[4] = {first, first + 1, first + g.n[1], first + g.n[1] + 1};
  std::uint64_t low[4], high[4];  // corners at x, at x + 1
  std::uint64_t any = 0, all = ~std::uint64_t{0}, whole = below(g.n[0] - 1);
  for (int i = 0; i < 4; ++i) {
    low[i] = rows[i]->inside.low;
    high[i] = low[i] >> 1 | rows[i]->inside.last << 63;
    any |= low[i] | high[i];
    all &= low[i] & high[i];
    whole &= rows[i]->number.low & (rows[i]->number.low >> 1 | rows[i]->number.last << 63);
  }
  const CaseTables& tables = g.map.mirrored ? kMirroredCaseTables : kCaseTables;
  const Plane& here = planes_[static_cast<std::size_t>(z & 1)];
  const Plane& above = planes_[static_cast<std::size_t>(~z & 1)];
  const auto row_of = [](const Plane& plane, int axis, int row) {
    return plane.data() + (axis * kGridPoints + row) * kGridPoints;
  };
  // By the numbers of a cell's edges.
  const std::uint32_t* numbers[12] = {
      row_of(here, 0, y),      row_of(here, 0, y + 1),  row_of(above, 0, y),
      row_of(above, 0, y + 1), row_of(here, 1, y),      row_of(here, 1, y) + 1,
      row_of(above, 1, y),     row_of(above, 1, y) + 1, row_of(here, 2, y),
      row_of(here, 2, y) + 1,  row_of(here, 2, y + 1),  row_of(here, 2, y + 1) + 1};
  for_each_bit(any & ~all & whole, [&](int x) {
    std::uint32_t index = 0;
    for (int i = 0; i < 4; ++i) index |= (bit(low[i], x) | bit(high[i], x) << 1) << (2 * i);
    const std::size_t count = tables.triangles[index], old = out.triangles.size();
    out.triangles.resize(old + count);
    const std::uint8_t* edges = tables.edges[index].data();
    for (std::size_t t = old; t < old + count; ++t, edges += 3)
      out.triangles[t] = {numbers[edges[0]][x], numbers[edges[1]][x], numbers[edges[2]][x]};
  });
}

std::uint32_t GridExtractor::add_seam_strips(const GridView& g, Mesh& out) {
  const std::size_t vertices = out.positions.size(), triangles = out.triangles.size();
  seam_of_.resize(vertices);
  auto next = static_cast<std::uint32_t>(vertices);
  for (std::size_t i = 0; i < vertices; ++i)
    if (faces_[i]) {
      seam_of_[i] = next;
      next += 2;
    }
  out.positions.resize(next);
  out.normals.resize(next);
  for (std::size_t i = 0; i < vertices; ++i)
    if (faces_[i]) {
      const std::size_t beside = seam_of_[i];
      out.positions[beside] = grid::beside(out.positions[i], out.normals[i], g.seam_strip);
      out.positions[beside + 1] = grid::beside(out.positions[i], out.normals[i], -g.seam_strip);
      out.normals[beside] = out.normals[beside + 1] = out.normals[i];
    }
  for (std::size_t t = 0; t < triangles; ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = out.triangles[t][k], b = out.triangles[t][(k + 1) % 3];
      if (!(faces_[a] & faces_[b])) continue;
      const std::uint32_t ra = seam_of_[a], rb = seam_of_[b];
      const std::size_t n = out.triangles.size();
      out.triangles.resize(n + 2);
      out.triangles[n] = {ra, rb, rb + 1};
      out.triangles[n + 1] = {ra, rb + 1, ra + 1};
    }
  return static_cast<std::uint32_t>(out.triangles.size() - triangles);
}

std::uint32_t GridExtractor::extract(const GridView& g, Mesh& out) {
  out.clear();
  meets_coarser_ = g.meets_coarser();
  faces_.clear();
  find_inside(g);
  for (int z = 0; z < g.n[2]; ++z) {
    for (int y = 0; y < g.n[1]; ++y) add_row(g, y, z, out);
    if (z > 0)
      for (int y = 0; y + 1 < g.n[1]; ++y) add_cells(g, y, z - 1, out);
  }
  return meets_coarser_ ? add_seam_strips(g, out) : 0;
}

}  // namespace isobrick

#include "viewer/scene/node_border.h"

#include <algorithm>

#include "surface/lod_seam.h"

namespace isobrick::inline v0 {
namespace {

/// The axes along a face.
constexpr int first_axis(int normal) { return normal == 0 ? 1 : 0; }
constexpr int second_axis(int normal) { return normal == 2 ? 1 : 2; }

/// Whether direction i is part of another direction in the mask: an edge of its face, a corner of
/// its face or edge.
bool on_larger(std::uint32_t mask, int i) {
  const Int3 d = direction(i);
  for (int j = 0; j < kDirections; ++j) {
    if (j == i || !(mask >> j & 1)) continue;
    const Int3 e = direction(j);
    bool part = true;
    for (int axis = 0; axis < 3; ++axis) part &= e[axis] == 0 || e[axis] == d[axis];
    if (part) return true;
  }
  return false;
}

}  // namespace

NodeBorder::Interpolation NodeBorder::interpolation(int axis, Index point) const {
  const Index r = ratio_[axis], first = point / r;
  if (point % r == 0) return {first, 0};
  const auto at = [&](int level, Index p) {
    return static_cast<double>(grid_.position(level, axis, p));
  };
  const double a = at(key_.level + 1, first), b = at(key_.level + 1, first + 1);
  const double weight = (at(key_.level, point) - a) / (b - a);
  return weight < 1 ? Interpolation{first, weight} : Interpolation{first + 1, 0};
}

float NodeBorder::interpolated(const GridValues& coarse, Int3 point) const {
  Interpolation b[3];
  for (int axis = 0; axis < 3; ++axis) b[axis] = interpolation(axis, point[axis]);
  const auto mix = [](float u, float v, double w) { return u + static_cast<float>(w) * (v - u); };
  const auto along_x = [&](Index y, Index z) {
    const float u = coarse.at({b[0].first, y, z});
    return b[0].weight > 0 ? mix(u, coarse.at({b[0].first + 1, y, z}), b[0].weight) : u;
  };
  const auto along_y = [&](Index z) {
    const float u = along_x(b[1].first, z);
    return b[1].weight > 0 ? mix(u, along_x(b[1].first + 1, z), b[1].weight) : u;
  };
  const float u = along_y(b[2].first);
  return b[2].weight > 0 ? mix(u, along_y(b[2].first + 1), b[2].weight) : u;
}

void NodeBorder::apply(const NodeKey& key, std::uint32_t coarser, double isovalue,
                       const CancellationToken& token, GridValues& field) {
  key_ = key;
  ratio_ = grid_.ratio(key.level);
  lo_ = field.points.lo;
  hi_ = field.points.hi - Int3{1, 1, 1};
  for (auto& face : faces_) face.reset();
  for (int i = 0; i < kDirections; ++i)
    if (coarser >> i & 1 && !on_larger(coarser, i)) take_values(i, isovalue, token, field);
}

void NodeBorder::take_values(int i, double isovalue, const CancellationToken& token,
                             GridValues& field) {
  const Int3 d = direction(i);
  Box3 points, coarse;
  int normal = 0, fixed = 0;
  for (int axis = 0; axis < 3; ++axis) {
    points.lo[axis] = d[axis] > 0 ? hi_[axis] : lo_[axis];
    points.hi[axis] = (d[axis] < 0 ? lo_[axis] : hi_[axis]) + 1;
    const Interpolation first = interpolation(axis, points.lo[axis]);
    const Interpolation last = interpolation(axis, points.hi[axis] - 1);
    coarse.lo[axis] = first.first;
    coarse.hi[axis] = last.first + (last.weight > 0 ? 2 : 1);
    if (d[axis] != 0) {
      normal = axis;
      ++fixed;
    }
  }
  samples_.read(key_.level + 1, coarse, isovalue, token, scratch_);
  for_each_point(points, [&](Int3 p) { field.at(p) = interpolated(scratch_, p); });
  if (fixed != 1) return;
  const int face = 2 * normal + (d[normal] > 0);
  faces_[static_cast<std::size_t>(face)] = scratch_;
  connect_inside(face, field);
}

/// The coarser side connects the inside corners of an ambiguous cell. The finer side does so only
/// if the cell's middle is inside, so this makes it inside, by a margin: at the isovalue itself all
/// vertices around the middle would coincide.
void NodeBorder::connect_inside(int face, GridValues& field) const {
  const int normal = face / 2, u = first_axis(normal), v = second_axis(normal);
  if (ratio_[u] != 2 && ratio_[v] != 2) return;
  const GridValues& coarse = *faces_[static_cast<std::size_t>(face)];
  for (Index j = coarse.points.lo[v]; j + 1 < coarse.points.hi[v]; ++j)
    for (Index i = coarse.points.lo[u]; i + 1 < coarse.points.hi[u]; ++i) {
      coarse::Cell cell{};
      for (int c = 0; c < 4; ++c) {
        Int3 p = coarse.points.lo;
        p[u] = i + (c & 1);
        p[v] = j + (c >> 1);
        cell.v[c] = coarse.at(p);
      }
      if (!cell.ambiguous()) continue;
      const float inside =
          std::min(std::max(cell.v[0], cell.v[1]), std::max(cell.v[2], cell.v[3])) / 2;
      Int3 middle = face % 2 ? hi_ : lo_;
      middle[u] = ratio_[u] * i + ratio_[u] / 2;
      middle[v] = ratio_[v] * j + ratio_[v] / 2;
      connect_through(middle, u, v, inside, field);
    }
}

/// Connects the inside corners of an ambiguous cell of the coarser side through its middle. If the
/// cell is halved along one axis only, through the middle of one of two opposite edges.
void NodeBorder::connect_through(Int3 middle, int u, int v, float inside, GridValues& field) const {
  // A cell that ends at the volume's border may have no middle.
  const auto exists = [&](int axis) { return ratio_[axis] == 1 || middle[axis] < hi_[axis]; };
  if (!exists(u) || !exists(v)) return;
  if (ratio_[u] == 2 && ratio_[v] == 2) {
    if (field.at(middle) < 0) field.at(middle) = inside;
    return;
  }
  const int whole = ratio_[u] == 2 ? v : u;  // axis along which the cell is not halved
  Int3 other = middle;
  ++other[whole];
  if (field.at(middle) >= 0 || field.at(other) >= 0) return;
  // Points on the node's edges belong to other nodes, too.
  if (other[whole] < hi_[whole])
    field.at(other) = inside;
  else if (middle[whole] > lo_[whole])
    field.at(middle) = inside;
}

void NodeBorder::describe(GridView& view) {
  for (int f = 0; f < 6; ++f) {
    const auto& coarse = faces_[static_cast<std::size_t>(f)];
    if (!coarse) continue;
    const Int3 n = coarse->points.extent();
    view.faces[f] = {
        coarse->values.data(),
        {static_cast<int>(n[first_axis(f / 2)]), static_cast<int>(n[second_axis(f / 2)])}};
  }
  for (int axis = 0; axis < 3; ++axis) {
    auto& places = places_[static_cast<std::size_t>(axis)];
    places.clear();
    const Interpolation last = interpolation(axis, hi_[axis]);
    const Index end = last.first + (last.weight > 0 ? 2 : 1);
    for (Index p = lo_[axis] / ratio_[axis]; p < end; ++p)
      places.push_back(static_cast<double>(grid_.position(key_.level + 1, axis, p)));
    view.ratio[axis] = static_cast<int>(ratio_[axis]);
    view.coarse_place[axis] = places.data();
    view.coarse_n[axis] = static_cast<int>(places.size());
  }
}

}  // namespace isobrick

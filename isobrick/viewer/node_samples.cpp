#include "isobrick/viewer/node_samples.h"

#include <algorithm>
#include <cstring>

namespace isobrick {
namespace {

/// Writes isovalue-free values of part of a brick to their places.
template <class T>
void copy_part(const std::byte* brick, Int3 brick_extent, Box3 from, double isovalue, float* to,
               Int3 to_extent) {
  const Int3 n = from.extent();
  for (Index z = 0; z < n.z; ++z)
    for (Index y = 0; y < n.y; ++y) {
      const auto* row =
          reinterpret_cast<const T*>(brick) + linear_index(from.lo + Int3{0, y, z}, brick_extent);
      float* out = to + (z * to_extent.y + y) * to_extent.x;
      for (Index x = 0; x < n.x; ++x)
        out[x] = static_cast<float>(static_cast<double>(row[x]) - isovalue);
    }
}

/// Between a and b. An end is itself whatever the other one is, infinite or no number.
float mix(float a, float b, float weight) { return a + weight * (b - a); }

}  // namespace

Box3 NodeSamples::samples(int v, Box3 points) const {
  Box3 box;
  for (int axis = 0; axis < 3; ++axis) {
    const auto hi = grid_.between(v, axis, points.hi[axis] - 1);
    box.lo[axis] = grid_.between(v, axis, points.lo[axis]).first;
    box.hi[axis] = hi.first + (hi.weight > 0 ? 2 : 1);
  }
  return box;
}

Box3 NodeSamples::bricks(int v, Box3 points) const {
  const Lattice& lattice =
      bricks_.source().info().levels[static_cast<std::size_t>(grid_.level(v).source)].lattice;
  const Box3 box = samples(v, points);
  const Int3 b = lattice.brick;
  return {{box.lo.x / b.x, box.lo.y / b.y, box.lo.z / b.z}, ceil_div(box.hi, b)};
}

void NodeSamples::gather(int stored, Box3 box, double isovalue, const Wanted& wanted) {
  const StoreInfo& info = bricks_.source().info();
  const Lattice& lattice = info.levels[static_cast<std::size_t>(stored)].lattice;
  const Int3 extent = box.extent(), edge = lattice.brick;
  gathered_.resize(static_cast<std::size_t>(volume(extent)));
  const Box3 cover{{box.lo.x / edge.x, box.lo.y / edge.y, box.lo.z / edge.z},
                   ceil_div(box.hi, edge)};
  const auto take = [&](Int3 b, const BrickSamples& brick) {
    const Int3 corner = b * edge;
    const Box3 part = intersect(box, {corner, corner + edge});
    float* to = gathered_.data() + linear_index(part.lo - box.lo, extent);
    if (!brick.empty()) {
      visit_scalar(lattice.type, [&](auto tag) {
        copy_part<typename decltype(tag)::type>(
            brick.data(), edge, {part.lo - corner, part.hi - corner}, isovalue, to, extent);
      });
      return;
    }
    const Int3 n = part.extent();
    for (Index z = 0; z < n.z; ++z)
      for (Index y = 0; y < n.y; ++y)
        std::fill_n(to + (z * extent.y + y) * extent.x, n.x,
                    static_cast<float>(info.fill_value - isovalue));
  };
  // Threads at nodes beside each other want the same bricks: were each to wait for what another
  // one is reading, all would read one brick after the other.
  std::vector<Int3> busy;
  for_each_point(cover, [&](Int3 b) {
    if (const auto brick = bricks_.get_unless_busy(stored, b, wanted))
      take(b, *brick);
    else
      busy.push_back(b);
  });
  for (const Int3 b : busy) take(b, *bricks_.get(stored, b, wanted));
}

void NodeSamples::read(int v, Box3 points, double isovalue, const Wanted& wanted, GridValues& out) {
  const Box3 box = samples(v, points);
  gather(grid_.level(v).source, box, isovalue, wanted);
  out.points = points;
  const Int3 from = box.extent(), n = points.extent();
  if (v == 0) {  // grid points are samples
    out.values.swap(gathered_);
    return;
  }
  struct Step {
    Index first;
    float weight;
  };
  std::vector<Step> steps[3];
  for (int axis = 0; axis < 3; ++axis)
    for (Index p = points.lo[axis]; p < points.hi[axis]; ++p) {
      const auto between = grid_.between(v, axis, p);
      steps[axis].push_back({between.first - box.lo[axis], static_cast<float>(between.weight)});
    }
  along_x_.resize(static_cast<std::size_t>(n.x * from.y * from.z));
  for (Index row = 0; row < from.y * from.z; ++row) {
    const float* in = gathered_.data() + row * from.x;
    float* to = along_x_.data() + row * n.x;
    for (const Step& s : steps[0])
      *to++ = s.weight > 0 ? mix(in[s.first], in[s.first + 1], s.weight) : in[s.first];
  }
  // Rows that are a whole step apart are mixed as rows.
  const auto mix_rows = [](const float* a, const Step& s, Index stride, Index length, float* to) {
    if (s.weight > 0)
      for (Index x = 0; x < length; ++x) to[x] = mix(a[x], a[stride + x], s.weight);
    else
      std::memcpy(to, a, static_cast<std::size_t>(length) * sizeof(float));
  };
  along_y_.resize(static_cast<std::size_t>(n.x * n.y * from.z));
  for (Index z = 0; z < from.z; ++z)
    for (Index y = 0; y < n.y; ++y) {
      const Step& s = steps[1][static_cast<std::size_t>(y)];
      mix_rows(along_x_.data() + (z * from.y + s.first) * n.x, s, n.x, n.x,
               along_y_.data() + (z * n.y + y) * n.x);
    }
  out.values.resize(static_cast<std::size_t>(volume(n)));
  for (Index z = 0; z < n.z; ++z) {
    const Step& s = steps[2][static_cast<std::size_t>(z)];
    mix_rows(along_y_.data() + s.first * n.x * n.y, s, n.x * n.y, n.x * n.y,
             out.values.data() + z * n.x * n.y);
  }
}

}  // namespace isobrick

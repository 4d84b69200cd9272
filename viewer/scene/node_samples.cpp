#include "viewer/scene/node_samples.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <span>

#include "core/copy_box.h"
#include "surface/grid_view.h"

namespace isobrick::inline v0 {
namespace {

/// Interpolates between a and b. At an end it returns that end, even if the other is infinite or
/// NaN.
float mix(float a, float b, float weight) { return a + weight * (b - a); }

}  // namespace

std::pair<Index, Index> NodeSamples::Axis::range(Index lo, Index hi) const {
  const auto first = std::lower_bound(samples.begin(), samples.end(), lo);
  return {first - samples.begin(), std::lower_bound(first, samples.end(), hi) - samples.begin()};
}

Box3 NodeSamples::bricks(int v, Box3 points) const {
  const Lattice& lattice =
      bricks_.source().info().levels[static_cast<std::size_t>(grid_.level(v).source)].lattice;
  Box3 bricks;
  for (int axis = 0; axis < 3; ++axis) {
    const auto lo = grid_.interpolation(v, axis, points.lo[axis]);
    const auto hi = grid_.interpolation(v, axis, points.hi[axis] - 1);
    bricks.lo[axis] = lo.first / lattice.brick[axis];
    bricks.hi[axis] = (hi.first + (hi.weight > 0)) / lattice.brick[axis] + 1;
  }
  return bricks;
}

/// Grid points may be many samples apart; samples between them are not read.
void NodeSamples::find_axis(int v, int axis, Index lo, Index hi) {
  Axis& a = axes_[static_cast<std::size_t>(axis)];
  a.samples.clear();
  a.points.clear();
  const auto add = [&](Index sample) {
    if (a.samples.empty() || a.samples.back() < sample) a.samples.push_back(sample);
  };
  for (Index p = lo; p < hi; ++p) {
    const auto between = grid_.interpolation(v, axis, p);
    add(between.first);
    a.points.push_back(
        {a.count() - 1 - (a.samples.back() - between.first), static_cast<float>(between.weight)});
    if (between.weight > 0) add(between.first + 1);
  }
}

/// Calls f(offset in the brick of a row's first sample, pointer into gathered_, positions of the
/// row's samples).
template <class F>
void NodeSamples::for_each_row(Int3 corner, Int3 edge, F&& f) {
  const auto [x0, x1] = axes_[0].range(corner.x, corner.x + edge.x);
  const auto [y0, y1] = axes_[1].range(corner.y, corner.y + edge.y);
  const auto [z0, z1] = axes_[2].range(corner.z, corner.z + edge.z);
  if (x0 == x1) return;
  const std::span places(axes_[0].samples.data() + x0, static_cast<std::size_t>(x1 - x0));
  for (Index z = z0; z < z1; ++z)
    for (Index y = y0; y < y1; ++y) {
      const Int3 first{corner.x, axes_[1].samples[static_cast<std::size_t>(y)],
                       axes_[2].samples[static_cast<std::size_t>(z)]};
      f(linear_index(first - corner, edge),
        gathered_.data() + (z * axes_[1].count() + y) * axes_[0].count() + x0, places);
    }
}

template <class T>
void NodeSamples::copy_part(const std::byte* brick, Int3 corner, Int3 edge, double isovalue) {
  for_each_row(corner, edge, [&](Index row, float* to, std::span<const Index> places) {
    const T* from = reinterpret_cast<const T*>(brick) + row - corner.x;
    const std::size_t n = places.size();
    if (places.back() - places.front() + 1 == static_cast<Index>(n)) {
      from += places.front();
      for (std::size_t x = 0; x < n; ++x) to[x] = point_value(from[x], isovalue);
    } else {
      for (std::size_t x = 0; x < n; ++x) to[x] = point_value(from[places[x]], isovalue);
    }
  });
}

/// The bounding box of all samples to read.
Box3 NodeSamples::box() const {
  Box3 box;
  for (int axis = 0; axis < 3; ++axis) {
    const Axis& a = axes_[static_cast<std::size_t>(axis)];
    box.lo[axis] = a.samples.front();
    box.hi[axis] = a.samples.back() + 1;
  }
  return box;
}

/// For the bricks in `box`: calls take(brick, samples) for those that are needed, and skip(part of
/// the box) for the others.
template <class Take, class Skip>
void NodeSamples::for_each_brick(int stored, Box3 box, const CancellationToken& token,
                                 const NeededSamples* needed, Take&& take, Skip&& skip) {
  const Lattice& lattice = bricks_.source().info().levels[static_cast<std::size_t>(stored)].lattice;
  needed_.clear();
  for_each_point(lattice.bricks_of(box), [&](Int3 b) {
    const Box3 part = intersect(box, lattice.full_brick_box(b));
    if (needed == nullptr || needed->any(part))
      needed_.push_back(b);
    else
      skip(part);
  });
  bricks_.read_together(stored, needed_, token);
  // Threads with adjacent nodes need the same bricks. If each waited for the brick that another
  // thread reads, all bricks would be read one after the other.
  std::vector<Int3> busy;
  for (const Int3 b : needed_)
    if (const auto brick = bricks_.get_unless_busy(stored, b, token))
      take(b, *brick);
    else
      busy.push_back(b);
  for (const Int3 b : busy) take(b, *bricks_.get(stored, b, token));
}

void NodeSamples::gather(int stored, double isovalue, const CancellationToken& token,
                         const NeededSamples* needed) {
  const StoreInfo& info = bricks_.source().info();
  const Lattice& lattice = info.levels[static_cast<std::size_t>(stored)].lattice;
  const Int3 edge = lattice.brick;
  const Box3 box = this->box();
  gathered_.resize(
      static_cast<std::size_t>(axes_[0].count() * axes_[1].count() * axes_[2].count()));
  const auto take = [&](Int3 b, const BrickSamples& brick) {
    const Int3 corner = b * edge;
    if (brick.empty())
      for_each_row(corner, edge, [&](Index, float* to, std::span<const Index> places) {
        std::fill_n(to, places.size(), point_value(info.fill_value, isovalue));
      });
    else
      visit_scalar(lattice.type, [&](auto tag) {
        copy_part<typename decltype(tag)::type>(brick.data(), corner, edge, isovalue);
      });
  };
  const auto skip = [&](Box3 part) {
    const Index first = linear_index(part.lo - box.lo, box.extent());
    needed->fill(part, -1.0f, 1.0f, gathered_.data() + first, box.extent());
  };
  for_each_brick(stored, box, token, needed, take, skip);
}

void NodeSamples::read_stored(Box3 points, const CancellationToken& token,
                              std::vector<std::byte>& out, const NeededSamples* needed) {
  const int stored = grid_.level(0).source;
  const StoreInfo& info = bricks_.source().info();
  const Lattice& lattice = info.levels[static_cast<std::size_t>(stored)].lattice;
  visit_scalar(lattice.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    out.resize(static_cast<std::size_t>(volume(points.extent())) * sizeof(T));
    const auto row_at = [&](Int3 p) {
      return reinterpret_cast<T*>(out.data()) + linear_index(p - points.lo, points.extent());
    };
    const auto take = [&](Int3 b, const BrickSamples& brick) {
      const Box3 all = lattice.full_brick_box(b), part = intersect(points, all);
      if (!brick.empty())
        return copy_box({brick.data(), all}, {out.data(), points}, part, sizeof(T));
      for (Index z = part.lo.z; z < part.hi.z; ++z)
        for (Index y = part.lo.y; y < part.hi.y; ++y)
          std::fill_n(row_at({part.lo.x, y, z}), part.extent().x, static_cast<T>(info.fill_value));
    };
    const auto skip = [&](Box3 part) {
      using Limits = std::numeric_limits<T>;
      needed->fill(part, Limits::lowest(), Limits::max(), row_at(part.lo), points.extent());
    };
    for_each_brick(stored, points, token, needed, take, skip);
  });
}

void NodeSamples::read(int v, Box3 points, double isovalue, const CancellationToken& token,
                       GridValues& out, const NeededSamples* needed) {
  for (int axis = 0; axis < 3; ++axis) find_axis(v, axis, points.lo[axis], points.hi[axis]);
  gather(grid_.level(v).source, isovalue, token, v == 0 ? needed : nullptr);
  out.points = points;
  if (v == 0) {  // grid points are samples
    out.values.swap(gathered_);
    return;
  }
  const Int3 from{axes_[0].count(), axes_[1].count(), axes_[2].count()}, n = points.extent();
  along_x_.resize(static_cast<std::size_t>(n.x * from.y * from.z));
  for (Index row = 0; row < from.y * from.z; ++row) {
    const float* in = gathered_.data() + row * from.x;
    float* to = along_x_.data() + row * n.x;
    for (const Axis::Point& s : axes_[0].points)
      *to++ = s.weight > 0 ? mix(in[s.first], in[s.first + 1], s.weight) : in[s.first];
  }
  // Whole rows are interpolated at once.
  const auto mix_rows = [](const float* a, const Axis::Point& s, Index stride, Index length,
                           float* to) {
    if (s.weight > 0)
      for (Index x = 0; x < length; ++x) to[x] = mix(a[x], a[stride + x], s.weight);
    else
      std::memcpy(to, a, static_cast<std::size_t>(length) * sizeof(float));
  };
  along_y_.resize(static_cast<std::size_t>(n.x * n.y * from.z));
  for (Index z = 0; z < from.z; ++z)
    for (Index y = 0; y < n.y; ++y) {
      const Axis::Point& s = axes_[1].points[static_cast<std::size_t>(y)];
      mix_rows(along_x_.data() + (z * from.y + s.first) * n.x, s, n.x, n.x,
               along_y_.data() + (z * n.y + y) * n.x);
    }
  out.values.resize(static_cast<std::size_t>(volume(n)));
  for (Index z = 0; z < n.z; ++z) {
    const Axis::Point& s = axes_[2].points[static_cast<std::size_t>(z)];
    mix_rows(along_y_.data() + s.first * n.x * n.y, s, n.x * n.y, n.x * n.y,
             out.values.data() + z * n.x * n.y);
  }
}

}  // namespace isobrick

#include "viewer/scene/slice_image.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

ScalarType image_type(ScalarType stored) {
  return stored == ScalarType::u8 || stored == ScalarType::u16 ? stored : ScalarType::f32;
}

/// A plane of a lattice and its two axes.
struct Plane {
  int normal, u, v;
  Index at;  ///< index along the normal
};

std::uint64_t image_bytes(const Lattice& lattice, int normal) {
  const Index all = volume(lattice.extent) / lattice.extent[normal];
  return static_cast<std::uint64_t>(all) * size_of(image_type(lattice.type));
}

template <class From, class To>
void copy_pixels(const From* brick, Int3 strides, const Plane& plane, Int3 lo, Int3 hi, Int3 corner,
                 Index width, To* pixels) {
  const Index at = (plane.at - corner[plane.normal]) * strides[plane.normal];
  for (Index j = lo[plane.v]; j < hi[plane.v]; ++j) {
    const From* row = brick + at + (j - corner[plane.v]) * strides[plane.v] +
                      (lo[plane.u] - corner[plane.u]) * strides[plane.u];
    To* to = pixels + j * width + lo[plane.u];
    for (Index i = lo[plane.u]; i < hi[plane.u]; ++i, row += strides[plane.u])
      *to++ = static_cast<To>(*row);
  }
}

/// Writes the pixels of one brick; null: the fill value.
template <class From>
void write_brick(const std::byte* brick, double fill, const Lattice& lattice, const Plane& plane,
                 Int3 b, SliceSamples& image) {
  using To =
      std::conditional_t<std::is_same_v<From, std::uint8_t> || std::is_same_v<From, std::uint16_t>,
                         From, float>;
  const Box3 box = lattice.brick_box(b);
  auto* pixels = reinterpret_cast<To*>(image.pixels.data());
  if (brick) {
    const Int3 strides{1, lattice.brick.x, lattice.brick.x * lattice.brick.y};
    copy_pixels(reinterpret_cast<const From*>(brick), strides, plane, box.lo, box.hi,
                b * lattice.brick, image.width, pixels);
    return;
  }
  for (Index j = box.lo[plane.v]; j < box.hi[plane.v]; ++j)
    std::fill_n(pixels + j * image.width + box.lo[plane.u], box.hi[plane.u] - box.lo[plane.u],
                static_cast<To>(fill));
}

void lay_out(const LevelInfo& level, const Plane& plane, SliceSamples& image) {
  Vec3d corner{-0.5, -0.5, -0.5}, wide, high;
  corner[plane.normal] = static_cast<double>(plane.at);
  wide = high = corner;
  wide[plane.u] += static_cast<double>(image.width);
  high[plane.v] += static_cast<double>(image.height);
  image.corner = level.transform.apply(corner);
  image.along_width = level.transform.apply(wide) - image.corner;
  image.along_height = level.transform.apply(high) - image.corner;
}

}  // namespace

SliceSamples read_slice(ResidentBricks& bricks, const SliceRequest& request,
                        const CancellationToken& token) {
  const StoreInfo& info = bricks.source().info();
  const auto levels = static_cast<int>(info.levels.size());
  if (request.axis < 0 || request.axis > 2 || request.stored < 0 || request.stored >= levels)
    throw UsageError("a slice of an axis or level that does not exist");
  SliceSamples image;
  image.request = request;
  image.stored = request.stored;
  const auto level_of = [&](int stored) -> const LevelInfo& {
    return info.levels[static_cast<std::size_t>(stored)];
  };
  while (image.stored + 1 < levels &&
         image_bytes(level_of(image.stored).lattice, request.axis) > request.bytes)
    ++image.stored;
  const LevelInfo& level = level_of(image.stored);
  const Lattice& lattice = level.lattice;
  if (image_bytes(lattice, request.axis) > request.bytes)
    throw UsageError("a slice exceeds its memory budget at every level");
  Plane plane{request.axis, request.axis == 0 ? 1 : 0, request.axis == 2 ? 1 : 2, 0};
  // All levels have the same directions, so only the origin differs.
  const Transform &finest = level_of(0).transform, &t = level.transform;
  Vec3d apart = finest.origin - t.origin;
  double shift = 0;
  for (int row = 0; row < 3; ++row)
    shift += t.direction[static_cast<std::size_t>(3 * row + request.axis)] * apart[row];
  const double at =
      (request.position * finest.spacing[request.axis] + shift) / t.spacing[request.axis];
  plane.at = std::clamp<Index>(std::lround(at), 0, lattice.extent[request.axis] - 1);
  image.width = lattice.extent[plane.u];
  image.height = lattice.extent[plane.v];
  image.type = image_type(lattice.type);
  image.pixels.resize(static_cast<std::size_t>(image.width * image.height) * size_of(image.type));
  lay_out(level, plane, image);
  Box3 cover{{0, 0, 0}, lattice.bricks()};
  cover.lo[plane.normal] = plane.at / lattice.brick[plane.normal];
  cover.hi[plane.normal] = cover.lo[plane.normal] + 1;
  for_each_point(cover, [&](Int3 b) {
    std::shared_ptr<const BrickSamples> brick;
    try {
      brick = bricks.get(image.stored, b, token);
    } catch (const Error& e) {
      if (image.damage.empty()) image.damage = e.what();
    }
    visit_scalar(lattice.type, [&](auto tag) {
      write_brick<typename decltype(tag)::type>(brick && !brick->empty() ? brick->data() : nullptr,
                                                info.fill_value, lattice, plane, b, image);
    });
  });
  return image;
}

}  // namespace isobrick

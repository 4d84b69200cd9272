#include "gpu/tile/tile_kernel.h"

#include <isobrick/error.h>
#include "gpu/tile/tile_launcher.cuh"

namespace isobrick::inline v0::gpu {
namespace {

template <int N>
LaunchShape shape_of(const TileKernel& kernel) {
  return visit_scalar(kernel.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    return kernel.normals ? Launcher<N, T, true>::shape() : Launcher<N, T, false>::shape();
  });
}

template <class T>
LaunchShape nan_shape(bool normals) {
  return normals ? Launcher<384, T, true, true>::shape() : Launcher<384, T, false, true>::shape();
}

}  // namespace

LaunchShapes launch_shapes(const TileKernel& kernel) {
  LaunchShapes shapes;
  if (kernel.on_samples)
    shapes.shapes[0] = shapes.shapes[1] = shapes.shapes[2] =
        kernel.trilinear ? trilinear_on_samples_shape(kernel.type, kernel.normals)
                         : on_samples_shape(kernel.type, kernel.normals);
  else if (kernel.trilinear)
    shapes.shapes[0] = shapes.shapes[1] = shapes.shapes[2] =
        trilinear_shape(kernel.type, kernel.normals, kernel.may_have_nan);
  else if (kernel.may_have_nan)
    shapes.shapes[0] = shapes.shapes[1] = shapes.shapes[2] = kernel.type == ScalarType::f64
                                                                 ? nan_shape<double>(kernel.normals)
                                                                 : nan_shape<float>(kernel.normals);
  else
    shapes = {shape_of<1024>(kernel), shape_of<640>(kernel), shape_of<384>(kernel)};
  if (shapes.shapes[2].blocks == 0)
    throw Error("the device has too little shared memory for the extraction kernel");
  return shapes;
}

const LaunchShape& LaunchShapes::of(std::uint32_t tiles, std::uint64_t cells) const {
  const auto threads_at_work = [](const LaunchShape& s) { return s.blocks * s.threads; };
  const LaunchShape* best = &shapes[2];
  if (cells > best->listed && shapes[1].blocks > 0 && shapes[1].listed > best->listed)
    best = &shapes[1];
  // Where shared memory is scarce, a larger block keeps more threads at work.
  for (const LaunchShape& shape : shapes)
    if (threads_at_work(shape) > 2 * threads_at_work(*best)) best = &shape;
  for (const LaunchShape& shape : shapes)
    if (shape.blocks > 0 && tiles <= static_cast<std::uint32_t>(shape.blocks)) return shape;
  return *best;
}

}  // namespace isobrick::gpu

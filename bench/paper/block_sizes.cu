#include "bench/paper/block_sizes.h"

#include <cstdint>

#include "gpu/tile/tile_launcher.cuh"

namespace isobrick::bench {

std::vector<gpu::LaunchShape> block_sizes() {
  std::vector<gpu::LaunchShape> shapes{gpu::Launcher<32, std::uint8_t, false>::shape(),
                                       gpu::Launcher<64, std::uint8_t, false>::shape(),
                                       gpu::Launcher<128, std::uint8_t, false>::shape(),
                                       gpu::Launcher<256, std::uint8_t, false>::shape(),
                                       gpu::Launcher<512, std::uint8_t, false>::shape(),
                                       gpu::Launcher<1024, std::uint8_t, false>::shape()};
  std::erase_if(shapes, [](const gpu::LaunchShape& shape) { return shape.blocks == 0; });
  return shapes;
}

}  // namespace isobrick::bench

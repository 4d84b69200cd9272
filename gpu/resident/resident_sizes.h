#pragma once

#include <cstdint>

#include <isobrick/device_volume.h>

namespace isobrick::inline v0::gpu {

/// Device memory that a resident volume and an extractor of it take.
struct ResidentSizes {
  std::uint64_t volume_bytes = 0;     ///< DeviceVolume::bytes() at most
  std::uint64_t extractor_bytes = 0;  ///< with a mesh as it is to be expected
};

/// How many tiles of a volume there are for which purpose.
struct ResidentTiles {
  std::uint64_t searched = 0, loaded = 0;  ///< as in DeviceTiles
  std::uint64_t active = 0;                ///< at one isovalue
};

ResidentSizes resident_sizes(const Lattice& lattice, const ResidentTiles& tiles, bool normals,
                             bool on_samples = false, bool trilinear = false);

/// Row tables from the beginning, 4.4 MiB: with fewer active tiles the first isovalue needs no
/// second launch.
inline constexpr std::uint32_t kFirstRowTables = 1024;

}  // namespace isobrick::gpu

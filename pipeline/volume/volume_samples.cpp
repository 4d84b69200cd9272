#include "pipeline/volume/volume_samples.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/level_info.h>

namespace isobrick::inline v0 {

void check_extent(Int3 extent) {
  if (!checked_volume(extent))
    throw UsageError(
        fmt::format("an extent of {}×{}×{} samples is none, or more than 64 bits count", extent.x,
                    extent.y, extent.z));
  if (std::max({extent.x, extent.y, extent.z}) > kMaxAxisSamples)
    throw UsageError(
        fmt::format("an extent of {}×{}×{} samples: more than {} along an axis are not supported",
                    extent.x, extent.y, extent.z, kMaxAxisSamples));
}

Int3 resolve_strides(Int3 strides, Int3 extent, Index bytes, const char* what) {
  if (strides == Int3{0, 0, 0}) return {bytes, bytes * extent.x, bytes * extent.x * extent.y};
  for (int axis = 0; axis < 3; ++axis) {
    if (extent[axis] == 1) strides[axis] = bytes;
    if (strides[axis] == 0)
      throw UsageError(fmt::format("the stride of the {} along {} is 0", what, "xyz"[axis]));
  }
  return strides;
}

VolumeSamples::VolumeSamples(const Volume& volume, SampleUse for_use)
    : transform(volume.transform), use(for_use) {
  check_extent(volume.extent);
  if (!volume.samples && !volume.read)
    throw UsageError("the volume has neither samples nor a function that reads them");
  if (volume.nodata) missing.nodata = as_sample(*volume.nodata, volume.type);
  missing.mask = volume.mask;
  if (volume.mask)
    missing.mask_strides = resolve_strides(volume.mask_strides, volume.extent, 1, "mask");
  lattice = {volume.extent, {64, 64, 64}, ArraySamples::type_of(volume.type, missing, use)};
  if (volume.samples) {
    const auto bytes = static_cast<Index>(size_of(volume.type));
    array.emplace(volume.extent,
                  SampleArray{static_cast<const std::byte*>(volume.samples),
                              {{0, 0, 0}, volume.extent},
                              resolve_strides(volume.strides, volume.extent, bytes, "samples"),
                              volume.type},
                  missing, use);
  }
  read = volume.read;
  concurrent = volume.concurrent_reads;
  read_type = volume.type;
}

VolumeSamples::VolumeSamples(VolumeSource& source)
    : lattice{source.info().extent, {64, 64, 64}, surface_type(source.info().type)},
      transform(source.info().transform),
      read([&source](Box3 box, std::byte* out) { source.read(box, out); }),
      concurrent(source.parallel()),
      read_type(source.info().type),
      source_bytes(source.memory()) {
  check_extent(lattice.extent);
  if (!source.random_access())
    throw UsageError(
        fmt::format("{} can be read only once from its begin to its end; convert it first",
                    source.info().name));
}

std::uint64_t VolumeSamples::range_bytes() const {
  return volume_ranges_bytes(lattice) + static_cast<std::uint64_t>(volume(lattice.tiles())) / 8;
}

void VolumeSamples::make_ranges() {
  if (ranges) return;
  known.resize(static_cast<std::size_t>(volume(lattice.tiles())));
  ranges = make_volume_ranges(lattice);
}

bool VolumeSamples::is_known(Box3 tiles) const {
  if (!ranges) return false;
  bool all = true;
  for_each_point(tiles, [&](Int3 t) {
    all = all && known[static_cast<std::size_t>(linear_index(t, lattice.tiles()))];
  });
  return all;
}

void VolumeSamples::set_known(Box3 tiles) {
  for_each_point(tiles, [&](Int3 t) {
    known[static_cast<std::size_t>(linear_index(t, lattice.tiles()))] = true;
  });
}

}  // namespace isobrick

#pragma once

#include <string>
#include <utility>

#include <isobrick/device_volume.h>
#include "tests/gpu/compare.h"

namespace isobrick::testing {

/// A volume on the device, and what extractors of it should make: the CPU's meshes.
template <class T>
struct Resident {
  Field<T> field;
  Lattice lattice;
  DenseBricks bricks;
  SurfaceOptions options;
  gpu::DeviceVolume volume;

  /// The region of interest is all where `options` leave it empty.
  explicit Resident(Field<T> f, const SurfaceOptions& o = {}, Index brick = 64)
      : field(std::move(f)),
        lattice{field.extent, {brick, brick, brick}, scalar_type_of<T>},
        bricks(lattice, field.samples.data()),
        options(o),
        volume(lattice, bricks, options.fill_value) {
    if (options.roi == Box3{}) options.roi = lattice.box();
  }

  /// Of an extractor with these options.
  void expect_mesh(gpu::ResidentExtractor& extractor, double isovalue) {
    SCOPED_TRACE("isovalue " + std::to_string(isovalue) + (options.normals ? ", normals" : ""));
    options.isovalue = isovalue;
    const isobrick::Mesh expected = on_cpu(field, lattice, bricks, options);
    const gpu::DeviceCounts counts = extractor.extract(isovalue);
    EXPECT_EQ(counts.vertices, expected.positions.size());
    EXPECT_EQ(counts.triangles, expected.triangles.size());
    EXPECT_EQ(counts.degenerate_triangles, left_out_on_cpu(field, lattice, bricks, options));
    isobrick::Mesh mesh;
    extractor.download(mesh);
    expect_same(expected, mesh);
  }
};

}  // namespace isobrick::testing

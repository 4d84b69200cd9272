#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <mutex>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include <isobrick/convert.h>
#include <isobrick/labels.h>
#include <isobrick/mesh_sinks.h>
#include "tests/pipeline/convert_doubles.h"
#include "tests/surface/mesh_topology.h"
#include "tests/temporary_folder.h"

namespace isobrick::inline v0 {

/// For messages of tests.
inline std::ostream& operator<<(std::ostream& out, const Label& label) {
  return out << label.text();
}

}  // namespace isobrick

namespace isobrick::test {

/// Stores of label images, and the meshes of their labels.
class Labels : public ::testing::Test {
 protected:
  template <class T>
  using Field = isobrick::testing::Field<T>;
  using Mesh = isobrick::testing::Mesh;
  using Meshes = std::map<Label, Mesh>;

  template <class T>
  StoreReader store(const Field<T>& field, Index brick = 64,
                    const Transform& transform = Transform()) {
    MemorySource source(field.extent, scalar_type_of<T>, as_bytes(field.samples));
    source.mutable_info().transform = transform;
    const auto path = folder_ / ("s" + std::to_string(next_++) + ".zarr");
    convert(source, path, {.brick = brick, .downsampling = Downsampling::mode});
    return StoreReader(path);
  }

  /// Of a store, or of a Volume.
  template <class Samples>
  static Meshes meshes_of(const Samples& store, const LabelOptions& options = {},
                          LabelReport* report = nullptr) {
    return collect([&](const LabelVisitor& visit) { return extract_labels(store, options, visit); },
                   report);
  }

  /// What `make` passes to the visitor that it gets.
  template <class Make>
  static Meshes collect(Make&& make, LabelReport* report = nullptr) {
    Meshes meshes;
    std::mutex mutex;
    const LabelReport made = make([&](const LabelMesh& label) {
      isobrick::Mesh mesh;
      MemorySink sink(mesh);
      label.write(sink);
      EXPECT_EQ(mesh.positions.size(), label.size().vertices);
      EXPECT_EQ(mesh.triangles.size(), label.size().triangles);
      const std::lock_guard lock(mutex);
      const bool is_new = meshes
                              .insert({label.label(),
                                       {{mesh.positions.begin(), mesh.positions.end()},
                                        {},
                                        {mesh.triangles.begin(), mesh.triangles.end()}}})
                              .second;
      EXPECT_TRUE(is_new) << label.label();
    });
    EXPECT_EQ(made.labels, meshes.size());
    if (report) *report = made;
    return meshes;
  }

  static Meshes meshes_of_all(const StoreReader& store, LabelOptions options = {}) {
    options.labels = {{-1000000, 1000000}};
    return meshes_of(store, options);
  }

  TemporaryFolder folder_;
  int next_ = 0;
};

/// Cells around random points, with background beyond a ball.
template <class T>
isobrick::testing::Field<T> cells(Int3 extent, int count, unsigned seed) {
  std::mt19937 random(seed);
  const auto below = [&](Index n) { return static_cast<Index>(random()) % n; };
  std::vector<Int3> points;
  for (int i = 0; i < count; ++i)
    points.push_back({below(extent.x), below(extent.y), below(extent.z)});
  return isobrick::testing::Field<T>(extent, [&](Int3 p) -> double {
    const Int3 from_middle = p * 2 - extent;
    if (dot(from_middle, from_middle) > extent.x * extent.x) return 0;
    std::size_t nearest = 0;
    for (std::size_t i = 1; i < points.size(); ++i)
      if (dot(p - points[i], p - points[i]) < dot(p - points[nearest], p - points[nearest]))
        nearest = i;
    return static_cast<double>(nearest + 1);
  });
}

}  // namespace isobrick::test

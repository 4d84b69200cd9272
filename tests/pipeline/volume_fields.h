#pragma once

#include <cstring>
#include <functional>
#include <random>
#include <vector>

#include <isobrick/volume_extractor.h>
#include "tests/pipeline/convert_store.h"
#include "tests/surface/field.h"

// Volumes of the caller's memory and functions, and the meshes that they must give.

namespace isobrick::inline v0 {

using testing::Field;

template <class T>
Volume volume_of(const Field<T>& field) {
  return Volume::of(field.samples.data(), field.extent);
}

/// A function that copies the samples of a box of a field, which must outlive it.
template <class T>
std::function<void(Box3, void*)> reader_of(const Field<T>& field) {
  return [&field](Box3 box, void* out) {
    auto* to = static_cast<T*>(out);
    for_each_point(box, [&](Int3 p) { *to++ = field.at(p); });
  };
}

inline bool same(const Mesh& mesh, const testing::Mesh& expected) {
  const auto equal = [](const auto& a, const auto& b) {
    return a.size() == b.size() &&
           (a.size() == 0 || std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0);
  };
  return equal(mesh.positions, expected.positions) && equal(mesh.normals, expected.normals) &&
         equal(mesh.triangles, expected.triangles);
}

/// The mesh through bricks, which the tests of the extractor compare with plain marching cubes.
template <class T>
testing::Mesh expected_mesh(const Field<T>& field, const ExtractOptions& options) {
  return testing::extract(field, {.isovalue = options.isovalue,
                                  .inside = options.inside.value_or(Inside::above),
                                  .normals = options.normals,
                                  .roi = options.roi,
                                  .drop_degenerate = options.drop_degenerate,
                                  .topology = options.topology});
}

template <class T>
Field<T> noise_with_calm(Int3 extent) {
  auto field = testing::padded_noise<T>(extent, 0, 100, T{0}, 11);
  for_each_point({{0, 0, 0}, {extent.x / 2, extent.y, extent.z}},
                 [&](Int3 p) { field.at(p) = static_cast<T>(p.z < extent.z / 2 ? 0 : 90); });
  return field;
}

/// Samples of a field at other strides, with what lies between them.
template <class T>
struct Strided {
  std::vector<std::byte> bytes;
  Volume volume;

  /// `order` lists the axes from the nearest samples to the farthest, `gap` bytes lie between two
  /// samples of that first axis, and axes of `backwards` run towards lower addresses.
  Strided(const Field<T>& field, std::array<int, 3> order, Index gap, std::array<bool, 3> backwards,
          std::size_t shift = 0) {
    const Int3 n = field.extent;
    Int3 strides;
    Index step = static_cast<Index>(sizeof(T)) + gap;
    for (const int axis : order) {
      strides[axis] = step;
      step *= n[axis];
    }
    bytes.assign(static_cast<std::size_t>(step) + shift, std::byte{0x5a});
    Index first = static_cast<Index>(shift);
    for (int axis = 0; axis < 3; ++axis)
      if (backwards[static_cast<std::size_t>(axis)]) {
        first += strides[axis] * (n[axis] - 1);
        strides[axis] = -strides[axis];
      }
    for_each_point(field.box(), [&](Int3 p) {
      std::memcpy(bytes.data() + first + dot(p, strides), &field.at(p), sizeof(T));
    });
    volume.samples = bytes.data() + first;
    volume.type = scalar_type_of<T>;
    volume.extent = n;
    volume.strides = strides;
  }
};

}  // namespace isobrick

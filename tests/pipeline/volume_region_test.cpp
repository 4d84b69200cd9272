#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include <isobrick/volume_extractor.h>
#include "tests/surface/field.h"

// Surfaces of a region of a volume behind a function.

namespace isobrick::test {
namespace {

using isobrick::testing::Field;

/// A volume of a field, of which only the samples of `known` are given.
Volume part_of(const Field<float>& field, Box3 known) {
  Volume volume{.extent = field.extent};
  volume.read = [&field, known](Box3 box, void* out) {
    auto* to = static_cast<float*>(out);
    float unknown = 1e30f;
    for_each_point(box, [&](Int3 p) {
      if (known.contains(p)) {
        *to++ = field.at(p);
      } else {
        unknown = unknown < 0 ? std::numeric_limits<float>::quiet_NaN() : -unknown;
        if (unknown != unknown) unknown = 1e30f;
        *to++ = unknown;
      }
    });
  };
  return volume;
}

template <class T>
bool equal(const PodBuffer<T>& a, const PodBuffer<T>& b) {
  return std::ranges::equal(a.span(), b.span());
}

TEST(VolumeRegion, SamplesBeyondALayerAroundItDoNotShow) {
  const auto field = isobrick::testing::padded_noise<float>({90, 80, 70}, 0, 100, 0.0f, 11);
  const Volume all = part_of(field, field.box());
  for (const Box3 roi : {Box3{{20, 21, 22}, {60, 50, 40}}, Box3{{0, 0, 30}, {90, 80, 51}},
                         Box3{{33, 0, 0}, {90, 31, 70}}})
    for (const ExtractOptions& surface :
         {ExtractOptions{.isovalue = 50}, ExtractOptions{.isovalue = 50, .normals = true},
          ExtractOptions{.isovalue = 50, .drop_degenerate = true},
          ExtractOptions{.isovalue = 50, .cap = true},
          ExtractOptions{.isovalue = 50, .topology = Topology::trilinear}}) {
      ExtractOptions options = surface;
      options.roi = roi;
      const Mesh expected = extract(all, options);
      EXPECT_GT(expected.triangles.size(), 1000u);
      const Index layers = options.normals ? 2 : 1;
      const Int3 around{layers, layers, layers};
      const Mesh mesh = extract(part_of(field, {roi.lo - around, roi.hi + around}), options);
      EXPECT_TRUE(equal(mesh.positions, expected.positions));
      EXPECT_TRUE(equal(mesh.normals, expected.normals));
      EXPECT_TRUE(equal(mesh.triangles, expected.triangles));
    }
}

}  // namespace
}  // namespace isobrick::test

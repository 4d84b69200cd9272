#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <isobrick/device.h>
#include "tests/surface/field.h"

namespace isobrick::testing {

template <class T>
std::vector<TileWork> active_tiles(const Field<T>& field, double isovalue) {
  std::vector<TileWork> tiles;
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<T>};
  append_active_tiles<T>({{0, 0, 0}, lattice.blocks()}, block_ranges(field), isovalue, tiles);
  return tiles;
}

/// The tiles that a surface needs, those of its cap included.
template <class T>
std::vector<TileWork> tiles_of(const Field<T>& field, const SurfaceOptions& options) {
  if (!options.cap) return active_tiles(field, options.isovalue);
  std::vector<TileWork> tiles;
  const Lattice lattice{field.extent, {64, 64, 64}, scalar_type_of<T>};
  append_capped_tiles<T>({{0, 0, 0}, lattice.blocks()}, block_ranges(field), options.isovalue,
                         {options.inside, options.roi, options.may_have_nan}, tiles);
  return tiles;
}

/// The mesh that those from a device are compared with.
template <class T>
isobrick::Mesh on_cpu(const Field<T>& field, const Lattice& lattice, const BrickLookup& bricks,
                      const SurfaceOptions& options) {
  const std::vector<TileWork> tiles = tiles_of(field, options);
  CpuExtractor extractor(lattice, options, {});
  extractor.extract(tiles, bricks, nullptr);
  return std::move(extractor.mesh());
}

/// The degenerate triangles that it left out.
template <class T>
std::uint64_t left_out_on_cpu(const Field<T>& field, const Lattice& lattice,
                              const BrickLookup& bricks, const SurfaceOptions& options) {
  CpuExtractor extractor(lattice, options, {});
  extractor.extract(tiles_of(field, options), bricks, nullptr);
  return extractor.report().degenerate_triangles;
}

template <class V>
bool same_bytes(const PodBuffer<V>& a, const PodBuffer<V>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(V)) == 0;
}

template <class V>
std::string first_difference(const PodBuffer<V>& a, const PodBuffer<V>& b) {
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    if (std::memcmp(&a[i], &b[i], sizeof(V)) != 0)
      return "first difference at " + std::to_string(i) + " of " + std::to_string(a.size());
  return "sizes " + std::to_string(a.size()) + " and " + std::to_string(b.size());
}

inline void expect_same(const isobrick::Mesh& cpu, const isobrick::Mesh& device) {
  EXPECT_TRUE(same_bytes(cpu.positions, device.positions))
      << first_difference(cpu.positions, device.positions);
  EXPECT_TRUE(same_bytes(cpu.normals, device.normals))
      << first_difference(cpu.normals, device.normals);
  EXPECT_TRUE(same_bytes(cpu.triangles, device.triangles))
      << first_difference(cpu.triangles, device.triangles);
}

/// A field a part of whose bricks of 32³ is absent, and so nothing but the fill value.
template <class T>
struct HoledField final : BrickLookup {
  T fill;
  Field<T> field;
  Lattice lattice;
  DenseBricks bricks;  ///< all of them

  HoledField(Field<T> f, T value)
      : fill(value),
        field(holed(std::move(f), value)),
        lattice{field.extent, {32, 32, 32}, scalar_type_of<T>},
        bricks(lattice, field.samples.data()) {}

  /// With normals, of the whole.
  SurfaceOptions options(double isovalue) const {
    SurfaceOptions options;
    options.roi = lattice.box();
    options.normals = true;
    options.isovalue = isovalue;
    options.fill_value = static_cast<double>(fill);
    return options;
  }

  static bool absent(Int3 b) { return (b.x + b.y + 2 * b.z) % 3 == 0; }
  const std::byte* find(Int3 b) const override { return absent(b) ? nullptr : bricks.find(b); }

 private:
  static Field<T> holed(Field<T> f, T value) {
    for_each_point(f.box(), [&](Int3 p) {
      if (absent({p.x / 32, p.y / 32, p.z / 32})) f.at(p) = value;
    });
    return f;
  }
};

/// Fields in the range of every type that has kernels.
template <class T>
struct TestFields {
  static constexpr double lowest() { return std::is_signed_v<T> ? -100.0 : 0.0; }
  static Field<T> noise(Int3 extent, unsigned seed) {
    return padded_noise<T>(extent, lowest(), lowest() + 200, static_cast<T>(lowest()), seed);
  }
  /// Few values, some of which are lowest() + 100.
  static Field<T> coarse(Int3 extent, unsigned seed, unsigned values = 4) {
    std::mt19937 random(seed);
    return Field<T>(extent,
                    [&](Int3) { return lowest() + 99 + static_cast<double>(random() % values); });
  }
  /// Nothing but around the corner of eight tiles, and little there.
  static Field<T> at_a_corner(unsigned seed) {
    std::mt19937 random(seed);
    const Index size = 1 + static_cast<Index>(seed % 4);
    const Int3 corner{32, 32, 32}, sizes{size, size, size};
    const Box3 core{corner - sizes, corner + sizes};
    return Field<T>({50, 45, 66}, [&](Int3 p) {
      if (p == corner) return lowest() + 101;
      return lowest() + (core.contains(p) && random() % (1 + seed / 4 % 5) == 0
                             ? static_cast<double>(99 + random() % 4)
                             : 99.0);
    });
  }
  static Field<T> waves(Int3 extent) {
    return Field<T>(extent, [&](Int3 p) {
      const auto f = [](Index v, double k) { return std::sin(static_cast<double>(v) * k); };
      return lowest() + 100 + 30 * (f(p.x, 0.11) + f(p.y, 0.13) + f(p.z, 0.07));
    });
  }
};

/// Skipped where there is no device.
template <class T>
class DeviceTest : public ::testing::Test, public TestFields<T> {
 protected:
  void SetUp() override {
    if (!gpu::device_available()) GTEST_SKIP() << "no CUDA device";
  }
};

/// A field with NaN: here and there and as a box over the corner of eight tiles.
template <class T>
Field<T> with_nan(Field<T> field, unsigned seed, int one_in) {
  constexpr T nan = std::numeric_limits<T>::quiet_NaN();
  std::mt19937 random(seed);
  for (T& v : field.samples)
    if (random() % static_cast<unsigned>(one_in) == 0) v = nan;
  for_each_point(intersect({{30, 29, 31}, {34, 50, 33}}, field.box()),
                 [&](Int3 p) { field.at(p) = nan; });
  return field;
}

inline constexpr double kWideIsovalue = 2e9 + 0.5;

/// Waves around kWideIsovalue whose values are nearer to each other than floats are there.
template <class T>
Field<T> wide_field() {
  return Field<T>({40, 37, 35}, [](Int3 p) {
    const auto f = [](Index v, double k) { return std::sin(static_cast<double>(v) * k); };
    return kWideIsovalue + 30 * (f(p.x, 0.31) + f(p.y, 0.23) + f(p.z, 0.17));
  });
}

using TypesWithNaN = ::testing::Types<float, double>;
using DeviceTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                     std::uint32_t, std::int32_t, float, double>;

}  // namespace isobrick::testing

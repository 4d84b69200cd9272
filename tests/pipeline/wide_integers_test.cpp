#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>

#include <isobrick/error.h>
#include <isobrick/export.h>
#include <isobrick/extract.h>
#include <isobrick/histogram.h>
#include <isobrick/label_index.h>
#include <isobrick/label_pieces.h>
#include <isobrick/recode.h>
#include <isobrick/verify.h>
#include <isobrick/volume_extractor.h>
#include "bricks/zarr/codec.h"
#include "pipeline/convert/store_source.h"
#include "tests/pipeline/foreign_image.h"
#include "tests/pipeline/labels_fixture.h"

// Volumes of 64-bit integers: kept exactly, and labels beyond 2⁵³.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// Samples for the labels of a small image, of which 0 stays.
struct BelowTheSign {
  using Sample = std::uint64_t;
  static Sample of(std::uint64_t label) { return label + (Sample{1} << 60); }
};
struct WithTheSign {
  using Sample = std::uint64_t;
  static Sample of(std::uint64_t label) { return label - 1 + (Sample{1} << 63); }
};
struct Negative {
  using Sample = std::int64_t;
  static Sample of(std::uint64_t label) { return -static_cast<Sample>(label) - (Sample{1} << 60); }
};

template <class Far>
typename Far::Sample far_label(std::int64_t label) {
  return label == 0 ? 0 : Far::of(static_cast<std::uint64_t>(label));
}

template <class Far, class Small>
isobrick::testing::Field<typename Far::Sample> far_field(
    const isobrick::testing::Field<Small>& small) {
  isobrick::testing::Field<typename Far::Sample> field(small.extent, [](Int3) { return 0.0; });
  std::transform(small.samples.begin(), small.samples.end(), field.samples.begin(),
                 [](Small label) { return far_label<Far>(label); });
  return field;
}

/// All samples of a level, as they are stored.
template <class T>
std::vector<T> samples_of(const StoreReader& reader, int level) {
  const StoreReader store = reader.native();
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  EXPECT_EQ(lattice.type, scalar_type_of<T>);
  std::vector<T> samples(static_cast<std::size_t>(volume(lattice.extent)));
  std::vector<T> brick(static_cast<std::size_t>(volume(lattice.brick)));
  for_each_point({{0, 0, 0}, lattice.bricks()}, [&](Int3 b) {
    if (!store.read_brick(level, b, reinterpret_cast<std::byte*>(brick.data())))
      std::fill(brick.begin(), brick.end(), store.info().fill_value.as<T>());
    for_each_point(lattice.brick_box(b), [&](Int3 p) {
      samples[static_cast<std::size_t>(linear_index(p, lattice.extent))] =
          brick[static_cast<std::size_t>(linear_index(p - b * lattice.brick, lattice.brick))];
    });
  });
  return samples;
}

template <class T>
class WideIntegers : public Labels {
 protected:
  using Limits = std::numeric_limits<T>;

  /// Noise among the largest numbers of the type, the smallest, and small ones.
  static std::vector<T> extremes(Int3 extent) {
    std::mt19937_64 random(5);
    std::vector<T> samples(static_cast<std::size_t>(volume(extent)));
    for (T& sample : samples) {
      const auto near = static_cast<T>(random() % 5);
      sample = random() % 3 == 0   ? static_cast<T>(Limits::max() - near)
               : random() % 2 == 0 ? static_cast<T>(Limits::lowest() + near)
                                   : near;
    }
    return samples;
  }
};

using IntegerTypes = ::testing::Types<std::uint64_t, std::int64_t>;
TYPED_TEST_SUITE(WideIntegers, IntegerTypes);

template <class Far>
class FarLabels : public Labels {
 protected:
  static Meshes far_meshes(const Meshes& small) {
    Meshes far;
    for (const auto& [label, mesh] : small)
      far.emplace(far_label<Far>(label.as_signed().value()), mesh);
    return far;
  }
};

using FarTypes = ::testing::Types<BelowTheSign, WithTheSign, Negative>;
TYPED_TEST_SUITE(FarLabels, FarTypes);

TYPED_TEST(WideIntegers, AreStoredExactly) {
  using T = TypeParam;
  const Int3 extent{37, 29, 23};
  const std::vector<T> samples = this->extremes(extent);
  for (const BrickCodec codec : {BrickCodec::zstd, BrickCodec::packed, BrickCodec::none}) {
    MemorySource source(extent, scalar_type_of<T>, as_bytes(samples));
    source.mutable_info().fill_value = std::numeric_limits<T>::max();
    const fs::path path = this->folder_ / "a.zarr", other = this->folder_ / "b.zarr";
    convert(source, path,
            {.brick = 16, .codec = codec, .downsampling = Downsampling::stride, .force = true});
    const StoreReader store(path);
    EXPECT_EQ(store.info().type, ScalarType::f64);
    EXPECT_EQ(store.info().stored_type, scalar_type_of<T>);
    EXPECT_EQ(store.info().fill_value, SampleValue(std::numeric_limits<T>::max()));
    EXPECT_EQ(samples_of<T>(store, 0), samples);
    EXPECT_EQ(samples_of<T>(store, 1).front(), samples.front());
    EXPECT_TRUE(verify(path).damages.empty());
    EXPECT_TRUE(stored_histogram(store).has_value());
    recode(store, other, {.codec = BrickCodec::packed, .force = true});
    EXPECT_EQ(samples_of<T>(StoreReader(other), 0), samples);
    EXPECT_TRUE(verify(other).damages.empty());
    const fs::path raw = this->folder_ / "a.raw";
    export_volume(store, raw, {.format = ExportFormat::raw, .force = true});
    std::ifstream file(raw, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    EXPECT_TRUE(bytes == std::string(reinterpret_cast<const char*>(samples.data()),
                                     samples.size() * sizeof(T)));
  }
}

TYPED_TEST(FarLabels, RangesHoldTheirSamples) {
  // Two labels that are one double make no block of one value.
  const auto field =
      far_field<TypeParam>(isobrick::testing::Field<std::uint8_t>({48, 16, 16}, [](Int3 p) {
        return p.x < 16 ? 1.0 : p.x < 40 ? 2.0 : 3.0;
      }));
  const StoreReader store = this->store(field, 16);
  const RangeTable table = store.block_ranges(0, {{0, 0, 0}, {3, 1, 1}});
  EXPECT_LT(table.ranges[0].lo, table.ranges[0].hi);
  EXPECT_EQ(table.ranges[1].lo, table.ranges[1].hi);
  EXPECT_LT(table.ranges[2].lo, table.ranges[2].hi);
}

TYPED_TEST(FarLabels, PyramidsByModeAndMean) {
  using T = typename TypeParam::Sample;
  // Of the same sign: the mode of equally frequent labels is the smallest.
  using Small = std::conditional_t<std::is_signed_v<T>, std::int16_t, std::uint16_t>;
  auto small = cells<Small>({41, 38, 35}, 25, 6);
  const auto labels = small;
  if (std::is_signed_v<T>)
    for (Small& label : small.samples) label = static_cast<Small>(-label);
  const StoreReader expected = this->store(small, 16);
  const StoreReader store = this->store(far_field<TypeParam>(labels), 16);
  ASSERT_GT(store.info().levels.size(), 1u);
  ASSERT_EQ(store.info().levels.size(), expected.info().levels.size());
  for (int level = 0; level < static_cast<int>(store.info().levels.size()); ++level) {
    const auto far = samples_of<T>(store, level);
    const auto near = samples_of<Small>(expected, level);
    ASSERT_EQ(far.size(), near.size());
    for (std::size_t i = 0; i < far.size(); ++i)
      ASSERT_EQ(far[i], far_label<TypeParam>(std::abs(static_cast<int>(near[i]))))
          << level << " " << i;
  }
  // Sums of eight do not overflow.
  const T most = std::numeric_limits<T>::max();
  MemorySource source({4, 2, 2}, scalar_type_of<T>,
                      as_bytes(std::vector<T>(16, static_cast<T>(most - 1))));
  const fs::path path = this->folder_ / "mean.zarr";
  convert(source, path, {.levels = 2});
  EXPECT_EQ(samples_of<T>(StoreReader(path), 1), std::vector<T>(2, static_cast<T>(most - 1)));
  std::vector<T> half(16, most);
  std::fill_n(half.begin(), 8, T{0});  // of each eight, four
  MemorySource halves({4, 2, 2}, scalar_type_of<T>, as_bytes(half));
  convert(halves, path, {.levels = 2, .force = true});
  EXPECT_EQ(samples_of<T>(StoreReader(path), 1), std::vector<T>(2, static_cast<T>(most / 2 + 1)));
}

TYPED_TEST(FarLabels, MeshesAreThoseOfSmallLabels) {
  using T = typename TypeParam::Sample;
  const auto small = cells<std::uint16_t>({70, 66, 50}, 40, 4);
  const auto far = far_field<TypeParam>(small);
  for (const int smooth : {0, 2}) {
    const auto expected = this->far_meshes(this->meshes_of(this->store(small), {.smooth = smooth}));
    ASSERT_GT(expected.size(), 20u);
    for (const Index brick : {16, 32, 64})
      EXPECT_EQ(this->meshes_of(this->store(far, brick), {.smooth = smooth, .threads = 3}),
                expected);
    Volume volume{.type = scalar_type_of<T>, .extent = far.extent};
    volume.samples = far.samples.data();
    EXPECT_EQ(this->meshes_of(volume, {.smooth = smooth}), expected);
    volume.samples = nullptr;
    volume.read = [&](Box3 box, void* out) {
      copy_box(reinterpret_cast<const std::byte*>(far.samples.data()), far.extent, sizeof(T), box,
               static_cast<std::byte*>(out));
    };
    EXPECT_EQ(this->meshes_of(volume, {.smooth = smooth}), expected);
  }
}

TYPED_TEST(FarLabels, PartsAndListsMakeTheSameMeshes) {
  const auto small = cells<std::uint16_t>({70, 66, 50}, 40, 4);
  const auto expected = this->far_meshes(this->meshes_of(this->store(small)));
  const StoreReader store = this->store(far_field<TypeParam>(small), 32);
  std::vector<fs::path> pieces;
  for (std::uint32_t i = 1; i <= 3; ++i) {
    pieces.push_back(this->folder_ / ("p" + std::to_string(i)));
    extract_label_piece(store, {}, {i, 3}, pieces.back());
  }
  EXPECT_EQ(this->collect(
                [&](const LabelVisitor& visit) { return merge_label_pieces(pieces, {}, visit); }),
            expected);
  // Neighbours that are one double stay two labels.
  const Label seven = far_label<TypeParam>(7);
  const LabelOptions some{.labels = {{seven, seven}}};
  add_label_index(store.storage()->local_path(), {});
  const StoreReader listed(store.storage()->local_path());
  LabelReport report;
  const auto one = this->meshes_of(listed, some, &report);
  EXPECT_GT(report.index_bytes, 0u);
  ASSERT_EQ(one.size(), 1u);
  EXPECT_EQ(one.at(seven), expected.at(seven));
  EXPECT_TRUE(verify(listed.storage()->local_path()).damages.empty());
  // A background beyond 2⁵³ leaves its neighbours.
  const auto without = this->meshes_of(store, {.background = seven});
  EXPECT_EQ(without.count(seven), 0u);
  EXPECT_EQ(without.size(), expected.size()) << "0 has a mesh, and the background none";
  EXPECT_EQ(without.at(far_label<TypeParam>(8)), expected.at(far_label<TypeParam>(8)));
}

TYPED_TEST(FarLabels, ListsTellNeighboursInWholeBricksApart) {
  // Each index brick of 64³ cells has one label, all of them one double.
  const auto field = far_field<TypeParam>(isobrick::testing::Field<std::uint8_t>(
      {129, 65, 65}, [](Int3 p) { return p.x < 65 ? 1.0 : 2.0; }));
  const StoreReader store = this->store(field, 64);
  const auto expected = this->meshes_of(store);
  ASSERT_EQ(expected.size(), 2u);
  // As the background one hides none of the other's whole blocks.
  for (const auto& [label, mesh] : expected) {
    const auto other = this->meshes_of(store, {.background = label});
    ASSERT_EQ(other.size(), 1u);
    EXPECT_EQ(other.begin()->second, expected.at(other.begin()->first));
  }
  add_label_index(store.storage()->local_path(), {});
  const StoreReader listed(store.storage()->local_path());
  for (const auto& [label, mesh] : expected)
    EXPECT_EQ(this->meshes_of(listed, {.labels = {{label, label}}}).at(label), mesh);
}

TYPED_TEST(FarLabels, OfOtherPrograms) {
  using T = typename TypeParam::Sample;
  const auto small = cells<std::uint16_t>({40, 33, 30}, 12, 8);
  const auto far = far_field<TypeParam>(small);
  const fs::path path = this->folder_ / "foreign.zarr";
  write_foreign<T>(path, far.extent, {17, 20, 13}, far.samples);
  EXPECT_EQ(samples_of<T>(StoreReader(path), 0), far.samples);
  const auto source = open_store_source(path, {}, 2, {});
  EXPECT_EQ(source->info().type, scalar_type_of<T>);
  add_label_index(path, {});
  const StoreReader indexed(path);
  EXPECT_TRUE(indexed.has_ranges(0));
  EXPECT_TRUE(verify(path).damages.empty());
  Transform transform;
  transform.spacing = {0.5, 1, 2};
  EXPECT_EQ(this->meshes_of(indexed),
            this->far_meshes(this->meshes_of(this->store(small, 64, transform))));
}

TYPED_TEST(WideIntegers, SurfacesAreOfDoubles) {
  using T = TypeParam;
  const Int3 extent{20, 20, 20};
  const auto ball = [](Int3 p) {
    const Int3 q = p * 2 - Int3{19, 19, 19};
    return 1000.0 - static_cast<double>(dot(q, q));
  };
  const isobrick::testing::Field<double> doubles(extent,
                                                 [&](Int3 p) { return std::max(ball(p), 0.0); });
  isobrick::testing::Field<T> integers(extent, [](Int3) { return 0.0; });
  std::transform(doubles.samples.begin(), doubles.samples.end(), integers.samples.begin(),
                 [](double v) { return static_cast<T>(v); });
  const auto surface = [](const auto& samples) {
    isobrick::Mesh mesh;
    MemorySink sink(mesh);
    extract(samples, {.isovalue = 600.5}, sink);
    return std::pair(std::vector(mesh.positions.begin(), mesh.positions.end()),
                     std::vector(mesh.triangles.begin(), mesh.triangles.end()));
  };
  const auto expected = surface(this->store(doubles, 16));
  ASSERT_FALSE(expected.first.empty());
  const StoreReader store = this->store(integers, 16);
  EXPECT_TRUE(surface(store) == expected);
  const fs::path packed = this->folder_ / "packed.zarr";
  recode(store, packed, {.codec = BrickCodec::packed});
  EXPECT_TRUE(surface(StoreReader(packed)) == expected);
  Volume volume{.type = scalar_type_of<T>, .extent = extent};
  volume.samples = integers.samples.data();
  EXPECT_TRUE(surface(volume) == expected);
  // What no double is.
  integers.at({3, 4, 5}) = (T{1} << 53) + 1;
  const auto refused = [&](const auto& samples) {
    try {
      surface(samples);
      ADD_FAILURE() << "accepted";
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find("9007199254740993 is no float64"), std::string::npos)
          << e.what();
    }
  };
  refused(volume);
  refused(this->store(integers, 16));
}

}  // namespace
}  // namespace isobrick::test

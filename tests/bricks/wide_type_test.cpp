#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "bricks/zarr/array_metadata.h"
#include "tests/bricks/store_fixture.h"

// Types of Zarr that surfaces are not made of: read without loss or not at all.
namespace isobrick::test {
namespace {

using nlohmann::json;

class WideTypes : public testing::Test {
 protected:
  /// Four samples in one chunk, of version 2 or 3.
  template <class Stored>
  void write(const std::string& type, std::vector<Stored> samples, const json& fill, int version) {
    std::filesystem::remove_all(path);
    json array{{"shape", {1, 2, 2}}, {"fill_value", fill}};
    if (version == 2) {
      array["zarr_format"] = 2;
      array["chunks"] = {1, 2, 2};
      array["dtype"] = type;
      array["order"] = "C";
      array["compressor"] = nullptr;
      array["filters"] = nullptr;
      if (type[0] == '>')
        for (Stored& s : samples) {
          auto* bytes = reinterpret_cast<std::byte*>(&s);
          std::reverse(bytes, bytes + sizeof s);
        }
      write_file(path / ".zarray", array.dump());
    } else {
      array["zarr_format"] = 3;
      array["node_type"] = "array";
      array["data_type"] = type;
      array["chunk_grid"] = {{"name", "regular"}, {"configuration", {{"chunk_shape", {1, 2, 2}}}}};
      array["chunk_key_encoding"] = {{"name", "v2"}};
      array["codecs"] = {{{"name", "bytes"}, {"configuration", {{"endian", "little"}}}}};
      write_file(path / "zarr.json", array.dump());
    }
    write_file(path / "0.0.0",
               std::string(reinterpret_cast<const char*>(samples.data()), 4 * sizeof(Stored)));
  }

  template <class T>
  void expect_samples(const std::vector<T>& expected) const {
    const StoreReader store(path);
    ASSERT_EQ(store.info().type, scalar_type_of<T>);
    std::vector<T> samples(4);
    ASSERT_TRUE(store.read_brick(0, {0, 0, 0}, reinterpret_cast<std::byte*>(samples.data())));
    EXPECT_EQ(samples, expected);
  }

  template <class T>
  void expect_native(const std::vector<T>& expected) const {
    const StoreReader surface(path), store = surface.native();
    ASSERT_EQ(store.info().type, scalar_type_of<T>);
    ASSERT_EQ(store.info().levels[0].lattice.type, scalar_type_of<T>);
    EXPECT_EQ(surface.info().type, ScalarType::f64);
    EXPECT_EQ(surface.info().stored_type, scalar_type_of<T>);
    EXPECT_FALSE(store.info().may_have_nan);
    std::vector<T> samples(4);
    ASSERT_TRUE(store.read_brick(0, {0, 0, 0}, reinterpret_cast<std::byte*>(samples.data())));
    EXPECT_EQ(samples, expected);
    EXPECT_EQ(surface.bytes_read(), store.bytes_read()) << "they share what is counted";
  }

  void expect_refused(const std::string& part) const {
    try {
      const StoreReader store(path);
      std::array<double, 4> samples;
      store.read_brick(0, {0, 0, 0}, reinterpret_cast<std::byte*>(samples.data()));
      ADD_FAILURE() << "accepted: " << part;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
      EXPECT_NE(std::string(e.what()).find(path.string()), std::string::npos) << e.what();
    }
  }

  TemporaryFolder folder;
  std::filesystem::path path = folder / "a.zarr";
};

TEST_F(WideTypes, IntegersThatADoubleHolds) {
  const std::uint64_t most = std::uint64_t{1} << 53, largest = ~std::uint64_t{0};
  for (const auto& [type, version] : {std::pair("uint64", 3), {"<u8", 2}, {">u8", 2}}) {
    write<std::uint64_t>(type, {0, 1, most, most << 10}, 0, version);
    expect_samples<double>({0, 1, 0x1p53, 0x1p63});
    expect_native<std::uint64_t>({0, 1, most, most << 10});
    write<std::uint64_t>(type, {0, most + 1, 0, 0}, 0, version);
    expect_refused("9007199254740993");
    write<std::uint64_t>(type, {0, most + 1, 0, largest}, 0, version);
    expect_native<std::uint64_t>({0, most + 1, 0, largest});
  }
  for (const auto& [type, version] : {std::pair("int64", 3), {"<i8", 2}}) {
    const auto lowest = std::numeric_limits<std::int64_t>::min();
    const auto highest = std::numeric_limits<std::int64_t>::max();
    write<std::int64_t>(type, {-1, 7, lowest, -9}, -5, version);
    expect_samples<double>({-1, 7, -0x1p63, -9});
    EXPECT_EQ(StoreReader(path).info().fill_value, -5);
    write<std::int64_t>(type, {0, highest, 0, lowest + 1}, 0, version);
    expect_refused("9223372036854775807");
    expect_native<std::int64_t>({0, highest, 0, lowest + 1});
  }
}

TEST_F(WideTypes, FillValuesAreExact) {
  const std::uint64_t largest = ~std::uint64_t{0};
  for (const auto& [type, version] : {std::pair("uint64", 3), {"<u8", 2}}) {
    write<std::uint64_t>(type, {0, 0, 0, 0}, largest - 1, version);
    const SampleValue fill = StoreReader(path).info().fill_value;
    EXPECT_EQ(fill.text(), "18446744073709551614");
    EXPECT_EQ(fill_bits(ScalarType::u64, fill), largest - 1);
    for (const json& bad : {json(-1), json(0.5), json(18446744073709551616.0), json("7"),
                            json(std::numeric_limits<std::int64_t>::min())}) {
      write<std::uint64_t>(type, {0, 0, 0, 0}, bad, version);
      expect_refused("fill_value");
    }
  }
  const std::int64_t lowest = std::numeric_limits<std::int64_t>::min();
  write<std::int64_t>("int64", {0, 0, 0, 0}, lowest + 1, 3);
  EXPECT_EQ(StoreReader(path).info().fill_value.text(), "-9223372036854775807");
  write<std::int64_t>("int64", {0, 0, 0, 0}, largest, 3);
  expect_refused("18446744073709551615 is no int64");
}

TEST_F(WideTypes, MetadataKeepsThemExact) {
  ArrayMetadata array;
  array.shape = array.chunk = {2, 2, 2};
  array.type = ScalarType::u64;
  array.fill_value = ~std::uint64_t{0};
  array.codecs = CodecChain::ours(3);
  const std::string text = to_json(array);
  EXPECT_NE(text.find("18446744073709551615"), std::string::npos) << text;
  EXPECT_NE(text.find("\"uint64\""), std::string::npos) << text;
  EXPECT_EQ(parse_array_metadata(text, "test"), array);
  array.fill_value = ~std::uint64_t{0} - 1;
  EXPECT_FALSE(parse_array_metadata(text, "test") == array);
}

TEST_F(WideTypes, HalfFloats) {
  for (const auto& [type, version] : {std::pair("float16", 3), {"<f2", 2}, {">f2", 2}}) {
    // 1, −2, the largest, the smallest above 0.
    write<std::uint16_t>(type, {0x3c00, 0xc000, 0x7bff, 0x0001}, "NaN", version);
    expect_samples<float>({1, -2, 65504, 0x1p-24F});
    EXPECT_TRUE(std::isnan(StoreReader(path).info().fill_value));
    EXPECT_TRUE(StoreReader(path).info().may_have_nan);
  }
  write<std::uint16_t>("float16", {0x7c00, 0xfc00, 0x8000, 0x03ff}, "0xc000", 3);
  expect_samples<float>({INFINITY, -INFINITY, -0.0F, 1023 * 0x1p-24F});
  EXPECT_EQ(StoreReader(path).info().fill_value, -2);
}

TEST_F(WideTypes, Bools) {
  for (const auto& [type, version] : {std::pair("bool", 3), {"|b1", 2}}) {
    write<std::uint8_t>(type, {0, 1, 1, 0}, true, version);
    expect_samples<std::uint8_t>({0, 1, 1, 0});
    EXPECT_EQ(StoreReader(path).info().fill_value, 1);
  }
}

TEST_F(WideTypes, OneOfSeveralChannelsInAChunk) {
  write<std::int64_t>("<i8", {-1, 7, 5, -9}, 0, 2);
  json array = json::parse(read_file(path / ".zarray"));
  array["shape"] = array["chunks"] = {2, 1, 1, 2};
  write_file(path / ".zarray", array.dump());
  std::filesystem::rename(path / "0.0.0", path / "0.0.0.0");
  const StoreReader store(path, {.channel = 1});
  std::vector<double> samples(2);
  ASSERT_TRUE(store.read_brick(0, {0, 0, 0}, reinterpret_cast<std::byte*>(samples.data())));
  EXPECT_EQ(samples, (std::vector<double>{5, -9}));
}

}  // namespace
}  // namespace isobrick::test

#include <gtest/gtest.h>

#include <array>

#include <nlohmann/json.hpp>

#include "bricks/zarr/codec.h"
#include "bricks/zarr/decompress.h"
#include "bricks/zarr/metadata_files.h"
#include "tests/bricks/store_fixture.h"

// Zarr version 2 as the specification has it; what real writers write is
// compared in tests/third_party/volumes/check_zarr.py.
namespace isobrick::test {
namespace {

using nlohmann::json;

class ZarrV2 : public testing::Test {
 protected:
  /// Samples 0, 1, 2, … of u16 over `shape`, each chunk a file.
  void write_array(const std::filesystem::path& at, const std::vector<Index>& shape,
                   const std::vector<Index>& chunks) const {
    json array = meta;
    array["shape"] = shape;
    array["chunks"] = chunks;
    write_file(at / ".zarray", array.dump());
    const std::string separator = array.value("dimension_separator", ".");
    const bool big = array["dtype"] == ">u2";
    std::vector<Index> count(shape.size()), chunk(shape.size());
    Index total = 1, per_chunk = 1;
    for (std::size_t i = 0; i < shape.size(); ++i) {
      count[i] = ceil_div(shape[i], chunks[i]);
      total *= count[i];
      per_chunk *= chunks[i];
    }
    for (Index c = 0; c < total; ++c) {
      std::string name, bytes;
      Index rest = c;
      for (std::size_t i = shape.size(); i-- > 0; rest /= count[i]) chunk[i] = rest % count[i];
      for (const Index k : chunk) name += (name.empty() ? "" : separator) + std::to_string(k);
      for (Index s = 0; s < per_chunk; ++s) {
        Index place = 0, inside = s, value = 0;
        std::vector<Index> p(shape.size());
        for (std::size_t i = shape.size(); i-- > 0; inside /= chunks[i])
          p[i] = chunk[i] * chunks[i] + inside % chunks[i];
        for (std::size_t i = 0; i < shape.size(); ++i) place = place * shape[i] + p[i];
        value = place;
        bytes += static_cast<char>(big ? value >> 8 : value & 0xff);
        bytes += static_cast<char>(big ? value & 0xff : value >> 8);
      }
      write_file(at / name, bytes);
    }
  }

  /// The samples that a whole volume must have, from `first` on.
  void expect_counting(const StoreReader& store, int level, Index first) const {
    const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
    std::vector<std::byte> brick(lattice.brick_bytes());
    for_each_point({{0, 0, 0}, lattice.bricks()}, [&](Int3 b) {
      ASSERT_TRUE(store.read_brick(level, b, brick.data()));
      for_each_point(lattice.brick_box(b), [&](Int3 p) {
        std::uint16_t value = 0;
        std::memcpy(&value, brick.data() + 2 * linear_index(p - b * lattice.brick, lattice.brick),
                    2);
        ASSERT_EQ(value, static_cast<std::uint16_t>(first + linear_index(p, lattice.extent)));
      });
    });
  }

  template <class E>
  void expect_refused(const std::string& part, const Selection& selection = {}) const {
    try {
      StoreReader store(path, selection);
      ADD_FAILURE() << "accepted: " << part;
    } catch (const E& e) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    }
  }

  TemporaryFolder folder;
  std::filesystem::path path = folder / "a.zarr";
  json meta{{"zarr_format", 2}, {"dtype", "<u2"},        {"order", "C"},
            {"fill_value", 7},  {"compressor", nullptr}, {"filters", nullptr}};
};

TEST_F(ZarrV2, AnArrayIsAnImageOfOneLevel) {
  for (const char* dtype : {"<u2", ">u2"})
    for (const char* separator : {"", ".", "/"}) {
      std::filesystem::remove_all(path);
      meta["dtype"] = dtype;
      meta.erase("dimension_separator");
      if (*separator != 0) meta["dimension_separator"] = separator;
      write_array(path, {4, 5, 7}, {2, 2, 3});
      const StoreReader store(path);
      EXPECT_EQ(store.info().levels[0].lattice, (Lattice{{7, 5, 4}, {3, 2, 2}, ScalarType::u16}));
      EXPECT_EQ(store.info().fill_value, 7);
      EXPECT_EQ(store.info().codec, "none");
      EXPECT_FALSE(store.info().ours);
      expect_counting(store, 0, 0);
    }
}

TEST_F(ZarrV2, DimensionsInAnotherOrderAreRefused) {
  write_array(path, {4, 5, 7}, {2, 2, 3});
  write_file(path / ".zattrs", R"({"_ARRAY_DIMENSIONS": ["z", "y", "x"]})");
  EXPECT_NO_THROW(StoreReader{path});
  write_file(path / ".zattrs", R"({"_ARRAY_DIMENSIONS": ["x", "y", "z"]})");
  try {
    StoreReader{path};
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("its dimensions are x, y, z"), std::string::npos)
        << e.what();
  }
}

TEST_F(ZarrV2, AnImageHasItsTransforms) {
  const auto transform = [](const char* type, std::vector<double> values) {
    return json{{"type", type}, {type, values}};
  };
  json axes = json::array();
  for (const char* name : {"z", "y", "x"})
    axes.push_back({{"name", name}, {"type", "space"}, {"unit", "nanometer"}});
  json scale{{"version", "0.4"}, {"axes", axes}};
  scale["datasets"] = {{{"path", "a/b"},
                        {"coordinateTransformations",
                         {transform("scale", {3, 2, 1}), transform("translation", {30, 20, 10})}}}};
  write_file(path / ".zattrs", json{{"multiscales", {scale}}}.dump());
  write_file(path / ".zgroup", R"({"zarr_format": 2})");
  write_array(path / "a/b", {4, 5, 7}, {4, 5, 7});
  const StoreReader store(path);
  const Transform& found = store.info().levels[0].transform;
  EXPECT_EQ(found.spacing, (Vec3d{1, 2, 3}));
  EXPECT_EQ(found.origin, (Vec3d{10, 20, 30}));
  EXPECT_EQ(found.unit, "nanometer");
  expect_counting(store, 0, 0);
  EXPECT_TRUE(is_zarr(path));
  EXPECT_FALSE(is_zarr(folder / "nothing"));
}

TEST_F(ZarrV2, ChannelsAndTimesWhereverChunksHoldThem) {
  for (const auto& [t, c] : {std::pair<Index, Index>{1, 1}, {2, 3}, {2, 2}, {1, 2}}) {
    std::filesystem::remove_all(path);
    write_array(path, {3, 4, 4, 5, 7}, {t, c, 2, 3, 4});
    for (Index time = 0; time < 3; ++time)
      for (Index channel = 0; channel < 4; ++channel) {
        const StoreReader store(path, {.channel = channel, .time = time});
        expect_counting(store, 0, (time * 4 + channel) * 4 * 5 * 7);
        EXPECT_EQ(store.info().additions,
                  "isobrick/time_" + std::to_string(time) + "_channel_" + std::to_string(channel));
        EXPECT_EQ(store.info().levels[0].decode_extra > 0, t * c > 1);
      }
    expect_refused<UsageError>("3 times: choose one with --time 0 … 2");
    expect_refused<UsageError>("4 channels: choose one with --channel 0 … 3", {.time = 0});
    expect_refused<UsageError>("--channel 4 is not there", {.channel = 4, .time = 0});
  }
  std::filesystem::remove_all(path);
  write_array(path, {1, 1, 4, 5, 7}, {1, 1, 4, 5, 7});
  EXPECT_EQ(StoreReader(path).info().additions, "");
  expect_counting(StoreReader(path, {.channel = 0, .time = 0}), 0, 0);
  expect_refused<UsageError>("--time 1 is not there", {.time = 1});
}

TEST_F(ZarrV2, AFourthAxisIsWhatItIsChosenFor) {
  write_array(path, {3, 4, 5, 7}, {2, 4, 5, 7});
  expect_counting(StoreReader(path, {.channel = 2}), 0, 2 * 140);
  expect_counting(StoreReader(path, {.time = 1}), 0, 140);
  expect_refused<UsageError>("choose one");
  expect_refused<UsageError>("choose one", {.channel = 0, .time = 0});
}

TEST_F(ZarrV2, AnAxisWithoutARoleTakesTheOneThatIsFree) {
  const auto write = [&](std::vector<std::string> leading) {
    std::filesystem::remove_all(path);
    json axes = json::array();
    for (const std::string& name : leading) axes.push_back({{"name", name}});
    for (const char* name : {"z", "y", "x"}) axes.push_back({{"name", name}, {"type", "space"}});
    std::vector<double> ones(axes.size(), 1);
    const json scale{
        {"version", "0.4"},
        {"axes", axes},
        {"datasets",
         {{{"path", "0"}, {"coordinateTransformations", {{{"type", "scale"}, {"scale", ones}}}}}}}};
    write_file(path / ".zattrs", json{{"multiscales", {scale}}}.dump());
    write_array(path / "0", {3, 4, 2, 5, 7}, {2, 2, 2, 2, 2});
  };
  write({"t", "phase"});
  for (Index time = 0; time < 3; ++time)
    for (Index phase = 0; phase < 4; ++phase)
      expect_counting(StoreReader(path, {.channel = phase, .time = time}), 0,
                      (time * 4 + phase) * 2 * 5 * 7);
  expect_refused<UsageError>("axis 'phase': choose one with --channel 0 … 3", {.time = 0});
  write({"phase", "c"});
  expect_counting(StoreReader(path, {.channel = 1, .time = 2}), 0, (2 * 4 + 1) * 2 * 5 * 7);
  EXPECT_EQ(StoreReader(path, {.channel = 1, .time = 2}).info().additions,
            "isobrick/time_2_channel_1");
  expect_refused<UsageError>("axis 'phase': choose one with --time 0 … 2", {.channel = 0});
}

TEST_F(ZarrV2, WhatIsBrokenIsNamed) {
  const auto expect = [&](const char* part, const char* key, const json& value, bool damage) {
    const json whole = meta;
    meta[key] = value;
    json array = meta;
    if (!array.contains("shape")) array["shape"] = {4, 5, 7};
    if (!array.contains("chunks")) array["chunks"] = {4, 5, 7};
    write_file(path / ".zarray", array.dump());
    damage ? expect_refused<DamageError>(part) : expect_refused<Error>(part);
    expect_refused<Error>(".zarray");
    meta = whole;
  };
  expect("zarr_format", "zarr_format", 3, true);
  expect("order 'F'", "order", "F", false);
  expect("'|O'", "dtype", "|O", false);
  expect("'<c8'", "dtype", "<c8", false);
  expect("structured", "dtype", json::array(), false);
  expect("filter 'x'", "filters", json::array({{{"id", "x"}}}), false);
  expect("'lzma'", "compressor", {{"id", "lzma"}}, false);
  expect("compressor: has no 'id'", "compressor", json::object(), true);
  expect("fill_value", "fill_value", "NaN", true);
  expect("separator", "dimension_separator", "-", true);
  expect("out of bounds", "shape", {Index{1} << 62, 4, 5}, true);
  expect("chunk", "chunks", {-1, 4, 5}, true);
  expect("must have 6", "shape", {1, 1, 1, 1, 1, 1}, true);
  write_file(path / ".zarray", "{");
  expect_refused<DamageError>(".zarray");
}

/// Eight times 0, eight times 1, … eight times 7.
std::vector<std::byte> steps() {
  std::vector<std::byte> bytes;
  for (int i = 0; i < 64; ++i) bytes.push_back(static_cast<std::byte>(i / 8));
  return bytes;
}

/// The same as other programs have compressed it, or as their formats have it.
std::vector<std::byte> compressed_steps(ByteCodec codec) {
  const auto bytes = [](std::initializer_list<int> values) {
    std::vector<std::byte> result;
    for (const int value : values) result.push_back(static_cast<std::byte>(value));
    return result;
  };
  if (codec == ByteCodec::zstd)
    return encode_bytes({.steps = {ByteCodec::zstd}, .zstd_level = 3}, steps());
  if (codec == ByteCodec::zlib)
    return bytes({0x78, 0xda, 0x63, 0x60, 0x80, 0x00, 0x46, 0x28, 0x60, 0x82,
                  0x02, 0x66, 0x28, 0x60, 0x81, 0x02, 0x56, 0x28, 0x60, 0x83,
                  0x02, 0x76, 0x28, 0x00, 0x00, 0x12, 0x30, 0x00, 0xe1});
  if (codec == ByteCodec::gzip)
    return bytes({0x1f, 0x8b, 0x08, 0x00, 0x00, 0x00, 0x00, 0x00, 0x02, 0xff, 0x63,
                  0x60, 0x80, 0x00, 0x46, 0x28, 0x60, 0x82, 0x02, 0x66, 0x28, 0x60,
                  0x81, 0x02, 0x56, 0x28, 0x60, 0x83, 0x02, 0x76, 0x28, 0x00, 0x00,
                  0x6c, 0xd1, 0x0a, 0xbb, 0x40, 0x00, 0x00, 0x00});
  if (codec == ByteCodec::lz4) {
    // The length; a literal and its repetition six times; sixteen literals.
    auto block = bytes({64, 0, 0, 0});
    for (int k = 0; k < 6; ++k)
      for (const std::byte b : bytes({0x13, k, 1, 0})) block.push_back(b);
    for (const std::byte b : bytes({0xf0, 1, 6, 6, 6, 6, 6, 6, 6, 6, 7, 7, 7, 7, 7, 7, 7, 7}))
      block.push_back(b);
    return block;
  }
  // Blosc: format 2, samples stored as they are.
  auto frame = bytes({2, 1, 2, 1, 64, 0, 0, 0, 64, 0, 0, 0, 80, 0, 0, 0});
  for (const std::byte b : steps()) frame.push_back(b);
  return frame;
}

TEST(Decompress, GivesBackWhatWasCompressed) {
  for (const ByteCodec codec :
       {ByteCodec::zstd, ByteCodec::gzip, ByteCodec::zlib, ByteCodec::lz4, ByteCodec::blosc}) {
    if (!can_decompress(codec)) continue;
    SCOPED_TRACE(name_of(codec));
    const std::vector<std::byte> encoded = compressed_steps(codec);
    std::vector<std::byte> out(64), more(65, std::byte{0xee}), less(63);
    EXPECT_EQ(decompress(codec, encoded, out), 64u);
    EXPECT_EQ(out, steps());
    EXPECT_EQ(decompress(codec, encoded, more), 64u);
    EXPECT_EQ(more.back(), std::byte{0xee});
    EXPECT_THROW(decompress(codec, encoded, less), DamageError);
    for (std::size_t size = 1; size < encoded.size(); ++size)
      EXPECT_THROW(decompress(codec, std::span(encoded).first(size), out), DamageError) << size;
  }
}

TEST(Decompress, RefusesWhatIsNotCompressed) {
  std::array<std::byte, 64> out{};
  for (const ByteCodec codec :
       {ByteCodec::zstd, ByteCodec::gzip, ByteCodec::zlib, ByteCodec::lz4, ByteCodec::blosc}) {
    if (!can_decompress(codec)) continue;
    for (const std::size_t size : {0u, 1u, 3u, 15u, 16u, 17u, 200u})
      for (const int byte : {0, 1, 0x1f, 0x78, 0xff}) {
        const std::vector<std::byte> encoded(size, static_cast<std::byte>(byte));
        try {
          EXPECT_LE(decompress(codec, encoded, out), out.size());
        } catch (const DamageError& e) {
          EXPECT_GT(std::string(e.what()).size(), 5u);
        }
      }
  }
  EXPECT_FALSE(can_decompress(ByteCodec::crc32c));
}

}  // namespace
}  // namespace isobrick::test

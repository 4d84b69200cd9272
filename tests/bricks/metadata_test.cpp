#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include <isobrick/image_metadata.h>
#include "bricks/zarr/array_metadata.h"
#include "tests/bricks/store_fixture.h"

namespace isobrick::test {
namespace {

ArrayMetadata sharded() {
  ArrayMetadata array;
  array.shape = {100, 200, 300};
  array.chunk = {64, 64, 128};
  array.type = ScalarType::f32;
  array.fill_value = -1.5;
  array.codecs = CodecChain::ours(5);
  array.sharding.emplace().brick = {32, 32, 32};
  array.dimension_names = {"z", "y", "x"};
  return array;
}

ImageMetadata image() {
  ImageMetadata result;
  result.name = "a \"name\"";
  Transform transform{{1, 2, 3}, {4, 5, 6}, {0, 1, 0, 0, 0, 1, 1, 0, 0}, "millimeter"};
  result.levels = {{"0", transform}, {"1", transform}};
  result.may_have_nan = true;
  result.checksum = 0xffffffff;
  return result;
}

/// The text with its first `from` replaced; a test that replaces nothing tests nothing.
std::string replaced(std::string text, const std::string& from, const std::string& to) {
  // What we write is indented; the tests' patterns are not.
  std::string dense;
  bool in_string = false;
  for (const char c : text) {
    if (c == '"') in_string = !in_string;
    if (in_string || (c != ' ' && c != '\n')) dense += c;
  }
  const std::size_t at = dense.find(from);
  EXPECT_NE(at, std::string::npos) << from << " in " << dense;
  return at == std::string::npos ? dense : dense.replace(at, from.size(), to);
}

template <class F>
void expect_error(bool damage, const std::string& part, F&& f) {
  try {
    f();
    ADD_FAILURE() << "accepted: " << part;
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    EXPECT_EQ(dynamic_cast<const DamageError*>(&e) != nullptr, damage) << e.what();
    EXPECT_NE(std::string(e.what()).find("file"), std::string::npos) << e.what();
  }
}

TEST(ArrayMetadata, RoundTrip) {
  ArrayMetadata array = sharded();
  EXPECT_EQ(parse_array_metadata(to_json(array), "file"), array);
  array.sharding->index_at_end = false;
  array.sharding->index_has_crc = false;
  array.codecs.big_endian = true;
  array.codecs.steps = {ByteCodec::crc32c, ByteCodec::zstd};
  array.separator = '.';
  EXPECT_EQ(parse_array_metadata(to_json(array), "file"), array);
  array.key_prefix = false;
  array.sharding.reset();
  EXPECT_EQ(parse_array_metadata(to_json(array), "file"), array);
  EXPECT_EQ(array.chunk_key(std::array<Index, 3>{1, 2, 3}), "1.2.3");
}

TEST(ArrayMetadata, PackedBricks) {
  ArrayMetadata array = sharded();
  array.codecs = CodecChain::of(BrickCodec::packed, 3, false);
  const std::string text = to_json(array);
  EXPECT_EQ(parse_array_metadata(text, "file").codecs, array.codecs);
  const auto refused = [&](const std::string& from, const std::string& to,
                           const std::string& part) {
    expect_error(false, part, [&] { parse_array_metadata(replaced(text, from, to), "file"); });
  };
  refused("\"version\":1", "\"version\":2", "version 2");
  refused("isobrick.packed", "isobrick.other", "isobrick.other");
  refused("{\"name\":\"crc32c\"}", "{\"name\":\"zstd\"}", "crc32c");
  refused("\"float32\"", "\"float16\"", "three axes");
  array.shape = {2, 100, 200, 300};
  array.chunk = {2, 64, 64, 128};
  array.sharding->brick = {2, 32, 32, 32};
  array.dimension_names = {};
  expect_error(false, "three axes", [&] { parse_array_metadata(to_json(array), "file"); });
}

TEST(ArrayMetadata, FillValues) {
  const auto parse = [](ScalarType type, const std::string& value) {
    ArrayMetadata array = sharded();
    array.type = type;
    array.fill_value = 77;
    return parse_array_metadata(replaced(to_json(array), is_floating(type) ? "77.0" : "77", value),
                                "file")
        .fill_value;
  };
  EXPECT_TRUE(std::isnan(parse(ScalarType::f32, "\"NaN\"")));
  EXPECT_EQ(parse(ScalarType::f64, "\"-Infinity\""), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(parse(ScalarType::f32, "\"0x3f800000\""), 1);
  EXPECT_EQ(parse(ScalarType::f64, "\"0x3ff0000000000000\""), 1);
  EXPECT_EQ(parse(ScalarType::f32, "0.1"), static_cast<double>(0.1f));
  EXPECT_EQ(parse(ScalarType::i32, "-2147483648"), -2147483648.0);
  EXPECT_EQ(parse(ScalarType::u32, "4294967295"), 4294967295.0);
  for (const auto& [type, value] : {std::pair(ScalarType::u8, "256"),
                                    {ScalarType::u8, "-1"},
                                    {ScalarType::i16, "0.5"},
                                    {ScalarType::u16, "\"NaN\""},
                                    {ScalarType::f32, "\"0x3f8000\""},
                                    {ScalarType::u8, "null"},
                                    {ScalarType::f32, "\"0x3f80000g\""},
                                    {ScalarType::f32, "1e39"},
                                    {ScalarType::f32, "true"},
                                    {ScalarType::f64, "\"nan\""},
                                    {ScalarType::i32, "18446744073709551615"}})
    EXPECT_THROW(parse(type, value), DamageError) << value;
}

TEST(ArrayMetadata, HostileValues) {
  const std::string text = to_json(sharded());
  const auto expect = [&](bool damage, const std::string& part, const std::string& from,
                          const std::string& to) {
    expect_error(damage, part, [&] { parse_array_metadata(replaced(text, from, to), "file"); });
  };
  const std::string shape = "\"shape\":[100,200,300]", shards = "[64,64,128]";
  const std::string bricks = "[32,32,32]";
  for (const char* bad : {"0", "-1", "1.5", "\"1\"", "null", "[1]", "true", "9223372036854775807",
                          "18446744073709551615", "1e3"}) {
    const std::string list = std::string("[") + bad + ",200,300]";
    expect(true, "", shape, "\"shape\":" + list);
    expect(true, "", shards, list);
    expect(true, "", bricks, list);
  }
  expect(true, "divide", bricks, "[33,32,32]");
  expect(true, "numbers", shards, "[64,64]");
  expect(true, "numbers", bricks, "[64,64,1,1]");
  expect(true, "array", shape, "\"shape\":7");
  expect(false, "dimensions", shape, "\"shape\":[]");
  expect(false, "dimensions", shape, "\"shape\":[1,1,1,1,1,1,1,1,1]");
  expect(true, "no 'shape'", shape + ",", "");
  expect(false, "bytes at a time", shards + "}}", "[1048576,1048576,1048576]}}");
  expect(false, "Zarr version", "\"zarr_format\":3", "\"zarr_format\":2");
  expect(true, "array", "\"node_type\":\"array\"", "\"node_type\":\"group\"");
  expect(false, "'complex64'", "float32", "complex64");
  expect(false, "'f32'", "float32", "f32");
  expect(false, "'lzma'", "zstd", "lzma");
  expect(false, "'numcodecs.bz2'", "zstd", "numcodecs.bz2");
  expect(false, "'transpose'", "\"name\":\"bytes\"", "\"name\":\"transpose\"");
  expect(false, "'rectilinear'", "regular", "rectilinear");
  expect(false, "'mine'", "\"name\":\"default\"", "\"name\":\"mine\"");
  expect(true, "separator", "\"separator\":\"/\"", "\"separator\":\"../\"");
  expect(true, "index_location", "\"end\"", "\"middle\"");
  expect(true, "endian", "\"endian\":\"little\"", "\"endian\":\"mixed\"");
  expect(true, "endian", "\"configuration\":{\"endian\":\"little\"}", "\"configuration\":{}");
  expect(false, "'novelty'", "\"zarr_format\":3", "\"novelty\":1,\"zarr_format\":3");
  EXPECT_NO_THROW(
      parse_array_metadata(replaced(text, "\"zarr_format\":3",
                                    "\"novelty\":{\"must_understand\":false},\"zarr_format\":3"),
                           "file"));
}

TEST(ArrayMetadata, EveryTruncationAndDeepNesting) {
  const std::string text = to_json(sharded());
  for (std::size_t size = 0; size + 2 < text.size(); ++size)
    EXPECT_THROW(parse_array_metadata(text.substr(0, size), "file"), DamageError);
  expect_error(true, "deep", [] { parse_array_metadata(std::string(1 << 20, '['), "file"); });
  expect_error(true, "too many",
               [] { parse_array_metadata(std::string(std::size_t{5} << 20, ' '), "file"); });
  expect_error(true, "JSON", [] { parse_array_metadata("{\"shape\":\"\xff\xfe\"}", "file"); });
}

TEST(ImageMetadata, RoundTrip) {
  ImageMetadata metadata = image();
  EXPECT_EQ(parse_image_metadata(to_json(metadata), "file"), metadata);
  for (ImageMetadata::Level& level : metadata.levels) {
    level.transform.direction = Transform().direction;
    level.transform.unit.clear();
  }
  EXPECT_EQ(to_json(metadata).find("direction"), std::string::npos);
  EXPECT_EQ(parse_image_metadata(to_json(metadata), "file"), metadata);
}

TEST(ImageMetadata, TransformationsOfTheWholeImageComeOnTop) {
  const std::string text =
      replaced(to_json(image()), "\"datasets\":",
               "\"coordinateTransformations\":[{\"type\":\"scale\",\"scale\":[2,2,10]},"
               "{\"type\":\"translation\",\"translation\":[0,0,1]}],\"datasets\":");
  const Transform transform = parse_image_metadata(text, "file").levels[0].transform;
  EXPECT_EQ(transform.spacing, (Vec3d{10, 4, 6}));
  EXPECT_EQ(transform.origin, (Vec3d{41, 10, 12}));
}

TEST(ImageMetadata, HostileValues) {
  const std::string text = to_json(image());
  const auto expect = [&](bool damage, const std::string& part, const std::string& from,
                          const std::string& to) {
    expect_error(damage, part, [&] { parse_image_metadata(replaced(text, from, to), "file"); });
  };
  expect(false, "version 4", "\"version\":3", "\"version\":4");
  for (const char* older : {"\"version\":1", "\"version\":2"})
    expect(false, "convert the volume anew", "\"version\":3", older);
  expect(true, "version", "\"version\":3", "\"version\":\"3\"");
  expect(false, "OME-Zarr 0.7", "\"0.5\"", "\"0.7\"");
  expect(false, "ome is missing", "\"ome\"", "\"omo\"");
  expect(false, "array", "\"group\"", "\"array\"");
  expect(false, "multiscale", "multiscales", "plate");
  expect(false, "'c'", "\"name\":\"z\"", "\"name\":\"c\"");
  expect(true, "must have 4 numbers", "\"axes\":[",
         "\"axes\":[{\"name\":\"t\",\"type\":\"time\"},");
  expect(false, "axis 'w'", "\"axes\":[", "\"axes\":[{\"name\":\"w\",\"type\":\"space\"},");
  const std::string axis = "{\"name\":\"t\",\"type\":\"time\"},";
  expect(false, "6 dimensions", "\"axes\":[", "\"axes\":[" + axis + axis + axis);
  expect(false, "units", "\"millimeter\"", "\"meter\"");
  expect(true, "positive", "\"scale\":[3.0,2.0,1.0]", "\"scale\":[3.0,0,1.0]");
  expect(true, "positive", "\"scale\":[3.0,2.0,1.0]", "\"scale\":[3.0,-2,1.0]");
  expect(true, "3 numbers", "\"scale\":[3.0,2.0,1.0]", "\"scale\":[1,3.0,2,1.0]");
  expect(true, "number", "\"scale\":[3.0,2.0,1.0]", "\"scale\":[null,1,1]");
  expect(true, "JSON", "\"scale\":[3.0,2.0,1.0]", "\"scale\":[1e999,1,1]");
  expect(false, "'affine'", "\"type\":\"scale\"", "\"type\":\"affine\"");
  const auto with_common = [&](const std::string& common) {
    expect(true, "finite",
           "\"datasets\":", "\"coordinateTransformations\":[" + common + "],\"datasets\":");
  };
  with_common("{\"type\":\"scale\",\"scale\":[1e308,1,1]}");
  expect(true, "number", "\"translation\":[6.0,5.0,4.0]", "\"translation\":[\"NaN\",1,1]");
  expect(true, "9 numbers", "\"direction\":[", "\"direction\":[1,");
  const std::string direction = "\"direction\":[0.0,1.0,0.0,0.0,0.0,1.0,1.0,0.0,0.0]";
  for (const char* bad : {"0,0,0,0,0,0,0,0,0", "0,1,0,0,0,1,1.001,0,0", "0,1,0,0,0.001,1,1,0,0",
                          "0,1,0,0,1,0,1,0,0", "1e200,0,0,0,1e200,0,0,0,1e200"})
    expect(true, "orthonormal", direction, std::string("\"direction\":[") + bad + "]");
  const auto read = [&](const std::string& to) {
    return parse_image_metadata(replaced(text, direction, "\"direction\":[" + to + "]"), "file");
  };
  EXPECT_NO_THROW(read("0,1,0,0,0,1,1.00001,0,0"));
  EXPECT_EQ(read("-1,0,0,0,1,0,0,0,1").levels[1].transform.direction[0], -1) << "mirrored";
  expect(true, "no checksum", "\"metadata_crc32c\":4294967295", "\"metadata_crc32c\":4294967296");
  expect(true, "no checksum", "\"metadata_crc32c\":4294967295", "\"metadata_crc32c\":-1");
  expect(true, "true or false", "\"may_have_nan\":true", "\"may_have_nan\":1");
  for (const char* path : {"", "/etc", "..", "../x", "0/../..", "a/.."})
    expect(true, "inside the store", "\"path\":\"0\"", std::string("\"path\":\"") + path + "\"");
}

TEST(ImageMetadata, UnknownVersionStopsTheReader) {
  const TemporaryFolder folder;
  write_store(folder / "file.zarr", {make_level(ScalarType::u8, {4, 4, 4}, 4, 4, 0, false)}, 3, 0);
  const std::filesystem::path root = folder / "file.zarr/zarr.json";
  write_file(root, replaced(read_file(root), "\"version\":3", "\"version\":99"));
  expect_error(false, "version 99", [&] { StoreReader store(folder / "file.zarr"); });
}

TEST(ImageMetadata, TheChecksumIsOverValuesOnly) {
  const std::string root = to_json(image());
  const std::vector<std::string> levels = {to_json(sharded()), to_json(sharded())};
  const auto checksum = [&](const std::string& text) {
    return metadata_checksum(text, levels, "file");
  };
  const std::uint32_t expected = checksum(root);
  EXPECT_EQ(checksum(nlohmann::json::parse(root).dump()), expected) << "order and blanks";
  EXPECT_EQ(checksum(replaced(root, "4294967295", "7")), expected) << "the checksum itself";
  EXPECT_EQ(checksum(replaced(root, "[3.0,2.0,1.0]", "[3,2e0,1.00]")), expected);
  EXPECT_EQ(checksum(replaced(root, "\"ome\":{", "\"ome\":{\"omero\":{},")), expected);
  EXPECT_EQ(checksum(replaced(root, "\"attributes\":{", "\"attributes\":{\"theirs\":1,")),
            expected);
  EXPECT_NE(checksum(replaced(root, "[3.0,2.0,1.0]", "[3.0,2.0,1.0000000000000002]")), expected);
  EXPECT_NE(checksum(replaced(root, "[6.0,5.0,4.0]", "[6.0,5.0,-4.0]")), expected);
  EXPECT_NE(checksum(replaced(root, "\"may_have_nan\":true", "\"may_have_nan\":false")), expected);
  EXPECT_NE(checksum(replaced(root, "\"isobrick\":{", "\"isobrick\":{\"new\":1,")), expected);
  auto changed = levels;
  changed[1] = replaced(changed[1], "-1.5", "-1.25");
  EXPECT_NE(metadata_checksum(root, changed, "file"), expected);
  changed[1] = replaced(levels[1], "\"attributes\":{}", "\"attributes\":{\"theirs\":1}");
  EXPECT_EQ(metadata_checksum(root, changed, "file"), expected);
}

TEST(StoreWriter, RefusesLayoutsThatNoReaderWouldTake) {
  const TemporaryFolder folder;
  const std::vector<Level> levels = {make_level(ScalarType::u8, {4, 4, 4}, 4, 4, 0, false)};
  const auto refused = [&](const std::string& part, auto&& change) {
    StoreLayout layout = make_layout(levels, 3, 0);
    change(layout.levels[0]);
    try {
      StoreWriter writer(folder / "a.zarr", layout, false);
      ADD_FAILURE() << part;
    } catch (const DamageError& e) {
      ADD_FAILURE() << e.what();
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    }
    EXPECT_FALSE(std::filesystem::exists(folder / "a.zarr"));
  };
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const double spacing : {0.0, -1.0, infinity, std::nan("")})
    refused("spacing", [&](LevelInfo& level) { level.transform.spacing.y = spacing; });
  refused("origin", [&](LevelInfo& level) { level.transform.origin.z = -infinity; });
  refused("orthonormal", [](LevelInfo& level) { level.transform.direction[1] = 0.001; });
  refused("orthonormal", [](LevelInfo& level) { level.transform.direction[4] = std::nan(""); });
  for (int axis = 0; axis < 3; ++axis)
    refused("more than 67108864 samples along an axis are not supported",
            [&](LevelInfo& level) { level.lattice.extent[axis] = kMaxAxisSamples + 1; });
}

}  // namespace
}  // namespace isobrick::test

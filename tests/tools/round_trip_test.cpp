#include <algorithm>

#include <fmt/format.h>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

class RoundTrip : public ProgramTest {
 protected:
  /// Converts `bytes`, exports level 0 and expects them back.
  void expect_same(const std::string& bytes, const Arguments& options) {
    write_file(path("in.raw"), bytes);
    Arguments convert{"convert", path("in.raw"), path("a.zarr"), "--force"};
    convert.insert(convert.end(), options.begin(), options.end());
    const Outcome converted = run(convert);
    ASSERT_EQ(converted.exit_code, 0) << converted.err;
    const Outcome exported = run({"export", path("a.zarr"), path("out.raw"), "--force"});
    ASSERT_EQ(exported.exit_code, 0) << exported.err;
    EXPECT_TRUE(read_file(path("out.raw")) == bytes);
  }
};

std::string dims_of(Int3 e) { return fmt::format("{},{},{}", e.x, e.y, e.z); }

std::size_t bytes_of(Int3 e, ScalarType type) {
  return static_cast<std::size_t>(volume(e)) * size_of(type);
}

TEST_F(RoundTrip, EveryType) {
  const Int3 extent{37, 23, 19};
  for (const ScalarType type : kScalarTypes) {
    SCOPED_TRACE(short_name(type));
    expect_same(noise(bytes_of(extent, type)),
                {"--dims", dims_of(extent), "--type", std::string(short_name(type)), "--brick",
                 "16", "--shard", "32"});
  }
}

TEST_F(RoundTrip, EveryTypeThroughNrrd) {
  const Int3 extent{37, 23, 19};
  for (const ScalarType type : kScalarTypes) {
    SCOPED_TRACE(short_name(type));
    const std::string bytes = noise(bytes_of(extent, type));
    write_file(path("in.raw"), bytes);
    const auto succeed = [&](const Arguments& arguments) {
      const Outcome outcome = run(arguments);
      ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    };
    succeed({"convert", path("in.raw"), path("a.zarr"), "--dims", dims_of(extent), "--type",
             std::string(short_name(type)), "--brick", "16", "--spacing", "0.3,1,2.7e-5",
             "--origin", "-1e-3,2,1e6", "--unit", "micrometer", "--force"});
    succeed({"export", path("a.zarr"), path("a.nrrd"), "--force"});
    succeed({"convert", path("a.nrrd"), path("b.zarr"), "--brick", "16", "--force"});
    const nlohmann::json a = run_json({"info", path("a.zarr")}),
                         b = run_json({"info", path("b.zarr")});
    for (const char* key : {"extent", "type", "spacing", "origin", "unit"})
      EXPECT_EQ(a[key], b[key]) << key;
    EXPECT_EQ(a["direction"], b["direction"]);
    succeed({"export", path("b.zarr"), path("b.raw"), "--force"});
    EXPECT_TRUE(read_file(path("b.raw")) == bytes);
    // And the file itself is a fixed point.
    succeed({"export", path("b.zarr"), path("b"), "--format", "nrrd", "--force"});
    EXPECT_TRUE(read_file(path("b")) == read_file(path("a.nrrd")));
  }
}

// A mesh of a part lies where it lies in the whole.
TEST_F(RoundTrip, ARegionKeepsItsPlaceInTheWorld) {
  const std::string store = path("a.zarr");
  write_file(path("in.nhdr"),
             "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 30 20 10\nspace dimension: 3\n"
             "space directions: (0,2,0) (-3,0,0) (0,0,0.5)\nspace origin: (100,200,300)\n"
             "space units: \"mm\" \"mm\" \"mm\"\nencoding: raw\ndata file: in.raw\n");
  write_file(path("in.raw"), noise(6000));
  ASSERT_EQ(run({"convert", path("in.nhdr"), store, "--brick", "16"}).exit_code, 0);
  ASSERT_EQ(run({"export", store, path("part.nrrd"), "--roi", "5:25,3:,1:9"}).exit_code, 0);
  const std::string header = read_file(path("part.nrrd")).substr(0, 400);
  EXPECT_NE(header.find("sizes: 20 17 8\n"), std::string::npos) << header;
  EXPECT_NE(header.find("space origin: (91,210,300.5)\n"), std::string::npos) << header;
  EXPECT_NE(header.find("space units: \"mm\""), std::string::npos) << header;
  ASSERT_EQ(run({"convert", path("part.nrrd"), path("b.zarr"), "--brick", "16"}).exit_code, 0);
  const nlohmann::json a = run_json({"info", store}), b = run_json({"info", path("b.zarr")});
  for (const char* key : {"type", "spacing", "direction", "unit"}) EXPECT_EQ(a[key], b[key]) << key;
  EXPECT_EQ(b["origin"], nlohmann::json({91.0, 210.0, 300.5}));
}

TEST_F(RoundTrip, ExtentsThatDivideNothing) {
  for (const Int3 extent : {Int3{1, 1, 1}, Int3{1, 17, 33}, Int3{131, 1, 7}, Int3{67, 61, 1}})
    for (const char* codec : {"zstd", "packed"}) {
      SCOPED_TRACE(dims_of(extent));
      expect_same(noise(bytes_of(extent, ScalarType::u16)),
                  {"--dims", dims_of(extent), "--type", "u16", "--brick", "16", "--codec", codec});
    }
}

TEST_F(RoundTrip, BricksCodecsAndThreads) {
  const Int3 extent{70, 65, 66};
  const std::string bytes = noise(bytes_of(extent, ScalarType::i16));
  for (const char* brick : {"16", "33", "64", "256"})
    for (const char* codec : {"none", "zstd:1", "packed"}) {
      SCOPED_TRACE(fmt::format("{} {}", brick, codec));
      expect_same(bytes, {"--dims", dims_of(extent), "--type", "i16", "--brick", brick, "--codec",
                          codec, "--threads", "3"});
    }
}

TEST_F(RoundTrip, ConstantVolume) {
  expect_same(std::string(40 * 40 * 40, '\x07'), {"--dims", "40,40,40", "--type", "u8"});
}

TEST_F(RoundTrip, BigEndianWithAnOffset) {
  const std::string samples = noise(10 * 11 * 12 * 4);
  std::string swapped = samples;
  for (std::size_t i = 0; i < swapped.size(); i += 4)
    std::reverse(swapped.begin() + static_cast<std::ptrdiff_t>(i),
                 swapped.begin() + static_cast<std::ptrdiff_t>(i + 4));
  write_file(path("in.raw"), "header!" + swapped);
  ASSERT_EQ(run({"convert", path("in.raw"), path("a.zarr"), "--dims", "10,11,12", "--type", "i32",
                 "--endian", "big", "--offset", "7"})
                .exit_code,
            0);
  ASSERT_EQ(run({"export", path("a.zarr"), path("out.raw")}).exit_code, 0);
  EXPECT_TRUE(read_file(path("out.raw")) == samples);
}

TEST_F(RoundTrip, ExtentAndTypeFromTheName) {
  const std::string samples = noise(10 * 11 * 12 * 2);
  write_file(path("engine_10x11x12_int16.raw"), samples);
  ASSERT_EQ(run({"convert", path("engine_10x11x12_int16.raw"), path("a.zarr")}).exit_code, 0);
  const nlohmann::json info = run_json({"info", path("a.zarr")});
  EXPECT_EQ(info["extent"], nlohmann::json({10, 11, 12}));
  EXPECT_EQ(info["type"], "int16");
}

TEST_F(RoundTrip, StandardInput) {
  const std::string samples = noise(30 * 31 * 32);
  write_file(path("in"), samples);
  ASSERT_EQ(run({"convert", "-", path("a.zarr"), "--dims", "30,31,32", "--type", "u8"},
                {.input = path("in")})
                .exit_code,
            0);
  ASSERT_EQ(run({"export", path("a.zarr"), path("out.raw")}).exit_code, 0);
  EXPECT_TRUE(read_file(path("out.raw")) == samples);
}

TEST_F(RoundTrip, ARegion) {
  const Int3 extent{30, 20, 10};
  const std::string samples = noise(bytes_of(extent, ScalarType::u8));
  write_file(path("in.raw"), samples);
  ASSERT_EQ(run({"convert", path("in.raw"), path("a.zarr"), "--dims", dims_of(extent), "--type",
                 "u8", "--brick", "16"})
                .exit_code,
            0);
  const nlohmann::json json =
      run_json({"export", path("a.zarr"), path("out.raw"), "--roi", "3:25,7:,:9"});
  EXPECT_EQ(json["extent"], nlohmann::json({22, 13, 9}));
  std::string wanted;
  for_each_point({{3, 7, 0}, {25, 20, 9}}, [&](Int3 p) {
    wanted += samples[static_cast<std::size_t>(linear_index(p, extent))];
  });
  EXPECT_TRUE(read_file(path("out.raw")) == wanted);
}

TEST_F(RoundTrip, SpacingOriginAndUnit) {
  write_file(path("in.raw"), noise(1000));
  ASSERT_EQ(run({"convert", path("in.raw"), path("a.zarr"), "--dims", "10,10,10", "--type", "u8",
                 "--spacing", "0.5,1,2", "--origin", "-1,2,-3", "--unit", "micrometer"})
                .exit_code,
            0);
  const nlohmann::json info = run_json({"info", path("a.zarr")});
  EXPECT_EQ(info["spacing"], nlohmann::json({0.5, 1.0, 2.0}));
  EXPECT_EQ(info["origin"], nlohmann::json({-1.0, 2.0, -3.0}));
  EXPECT_EQ(info["unit"], "micrometer");
}

TEST_F(RoundTrip, SynthIsTheSameAsStoreAndAsRawFile) {
  for (const std::string kind : {"sphere", "gyroid", "marschner-lobb", "mixing"}) {
    SCOPED_TRACE(kind);
    const Arguments options{"--dims", "33,29,31", "--type", "f32", "--force"};
    Arguments store{"synth", kind, path("a.zarr")}, raw{"synth", kind, path("a.raw")};
    store.insert(store.end(), options.begin(), options.end());
    raw.insert(raw.end(), options.begin(), options.end());
    ASSERT_EQ(run(store).exit_code, 0);
    ASSERT_EQ(run(raw).exit_code, 0);
    ASSERT_EQ(run({"export", path("a.zarr"), path("b.raw"), "--force"}).exit_code, 0);
    EXPECT_EQ(read_file(path("a.raw")).size(), 33u * 29 * 31 * 4);
    EXPECT_TRUE(read_file(path("a.raw")) == read_file(path("b.raw")));
  }
}

}  // namespace
}  // namespace isobrick::test

#include <cstring>
#include <filesystem>

#include "tests/tools/program.h"

// Labels of 64 bits, which doubles do not hold.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// Two labels, neighbours in doubles too.
class WideLabels : public ProgramTest {
 protected:
  static constexpr std::uint64_t kFirst = 720575940621039145u;  // as FlyWire's

  std::string write(std::uint64_t first = kFirst) const {
    std::string samples(8 * 8 * 8 * 8, '\0');
    const auto put = [&](std::size_t i, std::uint64_t value) {
      std::memcpy(samples.data() + 8 * i, &value, sizeof value);
    };
    for (std::size_t i = 0; i < 512; ++i) put(i, first + i / 256);
    write_file(path("big.nrrd"),
               "NRRD0004\ntype: uint64\ndimension: 3\nsizes: 8 8 8\nencoding: raw\n"
               "endian: little\nSegment0_ID:=a\nSegment0_Name:=big\n"
               "Segment0_LabelValue:=" +
                   std::to_string(first + 1) + "\nSegment0_Color:=1 0 0\n\n" + samples);
    return path("big.nrrd");
  }
  nlohmann::json list(const std::string& folder) const {
    return nlohmann::json::parse(read_file(path(folder) + "/labels.json"));
  }
};

TEST_F(WideLabels, KeepAllDigits) {
  run_json({"convert", write(), path("big.zarr")});
  for (const std::string& input : {path("big.nrrd"), path("big.zarr")}) {
    run_json({"extract", input, "--labels", "all", "-o", path("meshes"), "--force"});
    const nlohmann::json labels = list("meshes")["labels"];
    ASSERT_EQ(labels.size(), 2u);
    EXPECT_EQ(labels[0]["label"].get<std::uint64_t>(), kFirst);
    EXPECT_EQ(labels[0]["file"], "720575940621039145.ply");
    EXPECT_EQ(labels[1]["label"].get<std::uint64_t>(), kFirst + 1);
    EXPECT_EQ(labels[1]["name"], "big");
  }
  const nlohmann::json info = run_json({"info", path("big.zarr")});
  EXPECT_EQ(info["type"], "uint64");
  EXPECT_EQ(info["labels"][0]["label"].get<std::uint64_t>(), kFirst + 1);
  // Chosen by all digits, and by a range.
  for (const char* chosen : {"720575940621039146", "720575940621039146:720575940621039147"}) {
    run_json({"extract", path("big.zarr"), "--labels", chosen, "-o", path("meshes"), "--force"});
    ASSERT_EQ(list("meshes")["labels"].size(), 1u);
    EXPECT_EQ(list("meshes")["labels"][0]["label"].get<std::uint64_t>(), kFirst + 1);
  }
  expect_refused(
      run({"extract", path("big.zarr"), "--labels", "720575940621039144", "-o", path("never")}), 2,
      {"big.zarr", "no label 720575940621039144"});
  expect_refused(
      run({"extract", path("big.zarr"), "--labels", "9223372036854775808", "-o", path("never")}), 2,
      {"no label 9223372036854775808"});
  EXPECT_FALSE(fs::exists(path("never")));
}

TEST_F(WideLabels, KeepThemInEveryFolder) {
  run_json({"convert", write(), path("big.zarr")});
  const Outcome made = run({"extract", path("big.zarr"), "--labels", "all", "-o", path("ng"),
                            "--format", "neuroglancer"});
  if (made.err.find("built without") != std::string::npos) GTEST_SKIP() << made.err;
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const std::string properties = read_file(path("ng/segment_properties/info"));
  EXPECT_NE(properties.find("[\"720575940621039145\",\"720575940621039146\"]"), std::string::npos)
      << properties;
  run_json(
      {"extract", path("big.zarr"), "--labels", "all", "-o", path("tiles"), "--format", "3dtiles"});
  EXPECT_TRUE(fs::is_regular_file(path("tiles/720575940621039146/tileset.json")));
  // Parts make the same folder.
  run_json({"extract", path("big.zarr"), "--labels", "all", "-o", path("one")});
  for (const char* part : {"1/2", "2/2"})
    run_json({"extract", path("big.zarr"), "--labels", "all", "-o",
              path(std::string("p") + part[0] + ".piece"), "--part", part});
  run_json({"merge", path("p1.piece"), path("p2.piece"), "-o", path("two")});
  for (const char* name : {"720575940621039145.ply", "720575940621039146.ply"})
    EXPECT_TRUE(read_file(path("one/") + name) == read_file(path("two/") + name)) << name;
}

TEST_F(WideLabels, AreNoIsosurfaces) {
  run_json({"convert", write(), path("big.zarr")});
  expect_refused(run({"extract", path("big.zarr"), "--isovalue", "720575940621039232", "-o",
                      path("never.ply")}),
                 1, {"big.zarr", "720575940621039145", "no float64 exactly"});
  EXPECT_EQ(run({"export", path("big.zarr"), path("back.nrrd")}).exit_code, 0);
  const std::string back = read_file(path("back.nrrd")), before = read_file(path("big.nrrd"));
  EXPECT_TRUE(back.substr(back.size() - 4096) == before.substr(before.size() - 4096));
  EXPECT_NE(back.find("type: uint64"), std::string::npos);
}

TEST_F(WideLabels, AreNoOpenVdbGrids) {
  const std::string bytes = read_file(write());
  const std::size_t at = bytes.find("encoding");
  // All samples are the fill value in doubles.
  write_file(path("fill.nrrd"),
             bytes.substr(0, at) + "isobrick fill value:=720575940621039104\n" + bytes.substr(at));
  for (const char* name : {"big", "fill"}) {
    run_json({"convert", path(name) + ".nrrd", path(name) + ".zarr"});
    const Outcome outcome = run({"export", path(name) + ".zarr", path("never.vdb")});
    if (outcome.err.find("built without") != std::string::npos) GTEST_SKIP() << "no OpenVDB";
    expect_refused(outcome, 1, {"no float64 exactly"});
  }
}

TEST_F(WideLabels, HaveAll64Bits) {
  run_json({"convert", write(), path("near.zarr")});
  run_json({"extract", path("near.zarr"), "--labels", "all", "-o", path("near")});
  run_json({"convert", write(~std::uint64_t{0} - 1), path("far.zarr")});
  const std::string input = path("far.zarr");
  const nlohmann::json info = run_json({"info", input});
  EXPECT_EQ(info["labels"][0]["label"].get<std::uint64_t>(), ~std::uint64_t{0});
  run_json({"extract", input, "--labels", "all", "-o", path("far")});
  const nlohmann::json labels = list("far")["labels"];
  ASSERT_EQ(labels.size(), 2u);
  EXPECT_EQ(labels[0]["label"].get<std::uint64_t>(), ~std::uint64_t{0} - 1);
  EXPECT_EQ(labels[1]["label"].get<std::uint64_t>(), ~std::uint64_t{0});
  EXPECT_EQ(labels[1]["file"], "18446744073709551615.ply");
  EXPECT_EQ(labels[1]["name"], "big");
  EXPECT_TRUE(read_file(path("far/18446744073709551614.ply")) ==
              read_file(path("near/720575940621039145.ply")));
  EXPECT_TRUE(read_file(path("far/18446744073709551615.ply")) ==
              read_file(path("near/720575940621039146.ply")));
  // Parts make the same folder, and an output takes the place of another.
  for (const char* part : {"1/2", "2/2"})
    run_json({"extract", input, "--labels", "all", "-o",
              path(std::string("p") + part[0] + ".piece"), "--part", part});
  run_json({"merge", path("p1.piece"), path("p2.piece"), "-o", path("near"), "--force"});
  for (const char* name : {"/18446744073709551614.ply", "/18446744073709551615.ply"})
    EXPECT_TRUE(read_file(path("far") + name) == read_file(path("near") + name)) << name;
  EXPECT_EQ(list("far"), list("near"));
  run_json({"extract", input, "--labels", "all", "-o", path("tiles"), "--format", "3dtiles"});
  EXPECT_TRUE(fs::is_regular_file(path("tiles/18446744073709551615/tileset.json")));
  const Outcome made =
      run({"extract", input, "--labels", "all", "-o", path("ng"), "--format", "neuroglancer"});
  if (made.err.find("built without") != std::string::npos) return;
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_TRUE(fs::is_regular_file(path("ng/18446744073709551615.index")));
  const std::string properties = read_file(path("ng/segment_properties/info"));
  EXPECT_NE(properties.find("[\"18446744073709551614\",\"18446744073709551615\"]"),
            std::string::npos)
      << properties;
}

TEST_F(WideLabels, OfAll64BitsAreChosen) {
  run_json({"convert", write(~std::uint64_t{0} - 1), path("far.zarr")});
  const auto chosen = [&](const char* labels) {
    return Arguments{"extract", path("far.zarr"), std::string("--labels=") + labels,
                     "-o",      path("some"),     "--force"};
  };
  run_json({"index", path("far.zarr"), "--kind", "labels"});
  for (const auto& [labels, expected] : {std::pair("18446744073709551615", ~std::uint64_t{0}),
                                         {"0:18446744073709551614", ~std::uint64_t{0} - 1},
                                         {"-5:18446744073709551614", ~std::uint64_t{0} - 1}}) {
    EXPECT_GT(run_json(chosen(labels))["index_bytes"], 0);
    ASSERT_EQ(list("some")["labels"].size(), 1u) << labels;
    EXPECT_EQ(list("some")["labels"][0]["label"].get<std::uint64_t>(), expected) << labels;
  }
  expect_refused(run(chosen("-1")), 2, {"far.zarr", "no label -1"});
  expect_refused(run(chosen("18446744073709551613")), 2, {"no label 18446744073709551613"});
  expect_refused(run(chosen("18446744073709551616")), 2, {"'18446744073709551616' is no label"});
  expect_refused(run(chosen("18446744073709551615:0")), 2, {"ends before it begins"});
}

TEST_F(WideLabels, FillValuesKeepAllDigits) {
  const std::string bytes = read_file(write());
  const std::size_t at = bytes.find("encoding");
  write_file(
      path("fill.nrrd"),
      bytes.substr(0, at) + "isobrick fill value:=18446744073709551615\n" + bytes.substr(at));
  run_json({"convert", path("fill.nrrd"), path("fill.zarr")});
  const std::string text = run({"info", path("fill.zarr"), "--json"}).out;
  EXPECT_NE(text.find("\"fill_value\":18446744073709551615"), std::string::npos) << text;
  EXPECT_EQ(run({"export", path("fill.zarr"), path("fill2.nrrd")}).exit_code, 0);
  EXPECT_NE(read_file(path("fill2.nrrd")).find("isobrick fill value:=18446744073709551615"),
            std::string::npos);
}

}  // namespace
}  // namespace isobrick::test

#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>

#include <fmt/format.h>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

/// extract --attribute.
class Attribute : public ProgramTest {
 protected:
  Attribute() : store_(make_store("a")), other_(convert_field("b", {"--spacing", "2,2,2"})) {}

  /// A store with what no command but `convert` can give it.
  std::string convert_field(const std::string& name, const Arguments& more) const {
    const std::string raw = path(name + ".raw"), store = path(name + ".zarr");
    const Arguments form{"--dims", "40,36,33", "--type", "u8"};
    Arguments synth{"synth", "gyroid", raw}, convert{"convert", raw, store};
    synth.insert(synth.end(), form.begin(), form.end());
    convert.insert(convert.end(), form.begin(), form.end());
    convert.insert(convert.end(), more.begin(), more.end());
    EXPECT_EQ(run(synth).exit_code, 0);
    EXPECT_EQ(run(convert).exit_code, 0);
    return store;
  }

  Outcome extract(const std::string& output, const Arguments& more) const {
    Arguments words{"extract", store_, "--isovalue", "127.5", "-o", path(output), "--force"};
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  }
  /// What makes it fail, with nothing written.
  void refuse(const Arguments& more, std::initializer_list<std::string> parts,
              const std::string& output = "never.ply") const {
    expect_refused(extract(output, more), 2, parts);
    EXPECT_FALSE(std::filesystem::exists(path(output)));
  }
  std::string made(const std::string& output, const Arguments& more) const {
    const Outcome outcome = extract(output, more);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return read_file(path(output));
  }

  std::string store_, other_;
};

/// The last float of each vertex of a PLY with normals.
std::vector<float> last_floats(const std::string& ply, std::size_t floats) {
  const std::string end = "end_header\n", count = "element vertex ";
  const std::size_t vertices = std::stoul(ply.substr(ply.find(count) + count.size()));
  const char* row = ply.data() + ply.find(end) + end.size();
  std::vector<float> values(vertices);
  for (std::size_t i = 0; i < vertices; ++i)
    std::memcpy(&values[i], row + (i + 1) * floats * 4 - 4, 4);
  return values;
}

TEST_F(Attribute, OfTheVolumeItselfIsTheIsovalue) {
  const std::string ply = made("m.ply", {"--attribute", "itself=" + store_});
  EXPECT_NE(ply.find("property float nz\nproperty float itself\nelement face"), ply.npos);
  const std::vector<float> values = last_floats(ply, 7);
  ASSERT_GT(values.size(), 100u);
  for (const float value : values) ASSERT_NEAR(value, 127.5, 0.01);
}

TEST_F(Attribute, NothingButTheAttributeIsAdded) {
  const std::string with = made("with.ply", {"--attribute", "p=" + other_, "--normals", "none"});
  const std::string plain = made("plain.ply", {"--normals", "none"});
  const std::size_t vertices = last_floats(plain, 3).size();
  EXPECT_EQ(with.size(), plain.size() + 4 * vertices + std::strlen("property float p\n"));
}

TEST_F(Attribute, BudgetThreadsAndBricksNeverShow) {
  const std::string coarse = convert_field("c", {"--spacing", "2,2,2", "--brick", "16"});
  for (const char* name : {"m.ply", "m.glb", "m.vtp"}) {
    const Arguments plain{"--attribute", "p=" + other_, "--attribute", "q=" + store_};
    const std::string expected = made(name, plain);
    Arguments tight = plain;
    tight.insert(tight.end(), {"--memory", "64M", "--threads", "3"});
    EXPECT_EQ(made(name, tight), expected) << name;
    EXPECT_EQ(made(name, {"--attribute", "p=" + coarse, "--attribute", "q=" + store_}), expected);
  }
}

TEST_F(Attribute, IsOfTheVerticesThatLeaveTheFilters) {
  const std::string ply =
      made("m.ply", {"--attribute", "itself=" + store_, "--simplify", "50%", "--normals", "none"});
  for (const float value : last_floats(ply, 4)) ASSERT_NEAR(value, 127.5, 3);
}

TEST_F(Attribute, TheUnitOfTheMeshDoesNotChangeIt) {
  const std::string metric = convert_field("metric", {"--unit", "mm"});
  Arguments words{"extract",     metric,        "--isovalue",  "127.5",       "-o",
                  path("m.ply"), "--attribute", "p=" + other_, "--mesh-unit", "um"};
  ASSERT_EQ(run(words).exit_code, 0);
  const std::vector<float> scaled = last_floats(read_file(path("m.ply")), 7);
  words.resize(words.size() - 2);
  words[5] = path("n.ply");
  ASSERT_EQ(run(words).exit_code, 0);
  const std::vector<float> values = last_floats(read_file(path("n.ply")), 7);
  ASSERT_EQ(scaled.size(), values.size());
  for (std::size_t i = 0; i < values.size(); ++i) ASSERT_NEAR(scaled[i], values[i], 1e-2);
}

TEST_F(Attribute, EveryFormatThatHoldsThemDeclaresThem) {
  const Arguments both{"--attribute", "p=" + other_, "--attribute", "Temp_2=" + other_};
  EXPECT_NE(made("m.vtp", both).find("Name=\"Temp_2\" NumberOfComponents=\"1\""),
            std::string::npos);
  EXPECT_NE(made("m.pvtp", both).find("Name=\"Temp_2\" NumberOfComponents=\"1\""),
            std::string::npos);
  EXPECT_NE(made("m.glb", both).find("\"_TEMP_2\":3"), std::string::npos);
  Arguments quantized = both;
  quantized.push_back("--quantize");
  EXPECT_NE(made("q.glb", quantized).find("\"byteStride\":24"), std::string::npos);
}

TEST_F(Attribute, IsReportedAndEstimated) {
  const nlohmann::json report =
      run_json({"extract", store_, "--isovalue", "127.5", "-o", path("m.ply"), "--attribute",
                "p=" + other_})["surfaces"][0];
  EXPECT_EQ(report["attributes"], nlohmann::json::array({"p"}));
  const auto estimated = [&](const Arguments& more) {
    Arguments words{"extract", store_, "--isovalue", "127.5", "--estimate"};
    words.insert(words.end(), more.begin(), more.end());
    return run_json(words)["surfaces"][0];
  };
  const nlohmann::json plain = estimated({}), with = estimated({"--attribute", "p=" + other_});
  EXPECT_EQ(with["file_bytes"].get<int>(),
            plain["file_bytes"].get<int>() + 4 * plain["vertices"].get<int>());
  EXPECT_GT(with["memory_bytes"].get<std::int64_t>(), plain["memory_bytes"].get<std::int64_t>());
}

/// The colours of the vertices of a PLY, which end each row of `floats` floats and three bytes.
std::vector<std::array<int, 3>> last_colours(const std::string& ply, std::size_t floats) {
  const std::string end = "end_header\n", count = "element vertex ";
  const std::size_t vertices = std::stoul(ply.substr(ply.find(count) + count.size()));
  const char* row = ply.data() + ply.find(end) + end.size() + 4 * floats;
  std::vector<std::array<int, 3>> colours;
  for (std::size_t i = 0; i < vertices; ++i, row += 4 * floats + 3)
    colours.push_back({static_cast<std::uint8_t>(row[0]), static_cast<std::uint8_t>(row[1]),
                       static_cast<std::uint8_t>(row[2])});
  return colours;
}

/// All values are the isovalue, so all colours are one of the scale.
TEST_F(Attribute, ColoursAreThoseOfItsValues) {
  const auto colour = [&](const Arguments& more) {
    Arguments words{"--attribute", "p=" + store_, "--normals", "none"};
    words.insert(words.end(), more.begin(), more.end());
    const std::string ply = made("m.ply", words);
    EXPECT_NE(ply.find("property float p\nproperty uchar red\nproperty uchar green\n"
                       "property uchar blue\nelement face"),
              ply.npos);
    const auto colours = last_colours(ply, 4);
    for (const auto& c : colours)
      for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(c[i], colours[0][i], 1);
    return colours[0];
  };
  using Rgb = std::array<int, 3>;
  EXPECT_EQ(colour({"--colour-by", "p=127.6:300"}), (Rgb{0x44, 0x01, 0x54}));
  EXPECT_EQ(colour({"--colour-by", "p=-1:127.4"}), (Rgb{0xfd, 0xe7, 0x25}));
  EXPECT_EQ(colour({"--colour-by", "p=127.4:-1"}), (Rgb{0x44, 0x01, 0x54}));
  EXPECT_NEAR(colour({"--colour-by", "p=0:255", "--colour-map", "grey"})[0], 128, 1);
  EXPECT_NEAR(colour({"--colour-by", "p=0:255"})[1], 0x91, 1);
  EXPECT_EQ(colour({"--colour-by", "p=300:400", "--colour-map", "coolwarm"}),
            (Rgb{0x3b, 0x4c, 0xc0}));
}

TEST_F(Attribute, ColoursReachOverTheVolumeByThemselves) {
  const Outcome own = extract("own.ply", {"--attribute", "p=" + other_, "--colour-by", "p"});
  ASSERT_EQ(own.exit_code, 0) << own.err;
  const std::size_t at = own.err.find("colours of p reach from ");
  ASSERT_NE(at, own.err.npos) << own.err;
  int low = -1, high = -1;
  ASSERT_EQ(std::sscanf(own.err.c_str() + at, "colours of p reach from %d to %d", &low, &high), 2);
  EXPECT_GE(low, 0);
  EXPECT_GT(high, low + 100);
  const std::string range = fmt::format("p={}:{}", low, high);
  const std::string named = made("named.ply", {"--attribute", "p=" + other_, "--colour-by", range});
  EXPECT_EQ(read_file(path("own.ply")), named);
}

TEST_F(Attribute, ColoursAreInGlbAndOfParts) {
  const Arguments coloured{"--attribute", "p=" + other_, "--colour-by", "p=0:255"};
  for (const Arguments& form : {Arguments{"m.glb"}, {"q.glb", "--quantize"}}) {
    Arguments words = coloured;
    words.insert(words.end(), form.begin() + 1, form.end());
    const std::string glb = made(form[0], words);
    EXPECT_NE(glb.find("\"_P\":2,\"COLOR_0\":3"), glb.npos);
    for (const char* part : {"1/2", "2/2"})
      ASSERT_EQ(run({"extract", store_, "--isovalue", "127.5", "--part", part, "-o",
                     path(std::string(part, 1) + ".piece"), "--force"})
                    .exit_code,
                0);
    Arguments merge{"merge", path("1.piece"), path("2.piece"), "-o", path("merged.glb"), "--force"};
    merge.insert(merge.end(), words.begin(), words.end());
    const Outcome merged = run(merge);
    ASSERT_EQ(merged.exit_code, 0) << merged.err;
    EXPECT_EQ(read_file(path("merged.glb")), glb);
  }
  const auto bytes = [&](const Arguments& more) {
    Arguments words{"extract", store_, "--isovalue", "127.5", "--estimate", "--format", "glb"};
    words.insert(words.end(), more.begin(), more.end());
    return run_json(words)["surfaces"][0]["file_bytes"].get<double>();
  };
  const double size = static_cast<double>(std::filesystem::file_size(path("m.glb")));
  made("m.glb", coloured);
  EXPECT_NEAR(bytes(coloured), static_cast<double>(std::filesystem::file_size(path("m.glb"))),
              0.1 * size);
}

TEST_F(Attribute, RefusesColoursThatMakeNoSense) {
  const std::string p = "p=" + other_;
  refuse({"--colour-by", "p"}, {"--colour-by", "no attribute 'p'", "--attribute"});
  refuse({"--attribute", p, "--colour-by", "q"}, {"no attribute 'q'"});
  refuse({"--attribute", p, "--colour-by", "p=1"}, {"'p=1'", "NAME=LOW:HIGH"});
  refuse({"--attribute", p, "--colour-by", "p=1:x"}, {"'x'"});
  refuse({"--attribute", p, "--colour-by", "p=1:1"}, {"differ"});
  refuse({"--attribute", p, "--colour-map", "grey"}, {"--colour-by"});
  refuse({"--attribute", p, "--colour-by", "p", "--colour-map", "jet"}, {"'jet'", "viridis"});
  refuse({"--attribute", p, "--colour-by", "p"}, {"--colour-by", "VTP"}, "never.vtp");
}

TEST_F(Attribute, RefusesWhatMakesNoSense) {
  refuse({"--attribute", "p"}, {"'p' is no attribute", "NAME=STORE"});
  refuse({"--attribute", "=a"}, {"is no attribute"});
  refuse({"--attribute", "p="}, {"is no attribute"});
  refuse({"--attribute", "2p=" + other_}, {"'2p' is no name of an attribute"});
  refuse({"--attribute", "nx=" + other_}, {"'nx'", "already"});
  refuse({"--attribute", "p=" + other_, "--attribute", "P=" + other_}, {"'P' is given twice"});
  refuse({"--attribute", "p=" + other_}, {"STL cannot hold attributes"}, "never.stl");
  refuse({"--attribute", "p=" + other_}, {"OBJ cannot hold attributes"}, "never.obj");
  refuse({"--attribute", "p=" + other_ + ":3"}, {"--channel", "3"});
  expect_refused(extract("never.ply", {"--attribute", "p=" + path("none.zarr")}), 1, {"none.zarr"});
  expect_refused(
      run({"extract", store_, "--labels", "all", "-o", path("l"), "--attribute", "p=" + other_}), 2,
      {"--attribute", "--labels"});
}

}  // namespace
}  // namespace isobrick::test

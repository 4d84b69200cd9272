#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

class IsovalueOption : public ProgramTest {
 protected:
  std::vector<double> isovalues(const std::string& store, const Arguments& more) {
    Arguments arguments{"extract", store, "--estimate"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    std::vector<double> values;
    const nlohmann::json result = run_json(arguments);
    for (const auto& surface : result["surfaces"])
      values.push_back(surface["isovalue"].get<double>());
    return values;
  }
};

TEST_F(IsovalueOption, EveryFormOfTheGrammar) {
  const std::string store = make_store("a");
  EXPECT_EQ(isovalues(store, {"--isovalue", "100,150", "--isovalue", "120"}),
            (std::vector<double>{100, 150, 120}));
  EXPECT_EQ(isovalues(store, {"--isovalue", "100:140:20"}), (std::vector<double>{100, 120, 140}));
  const nlohmann::json info = run_json({"info", store});
  const double lo = info["value_range"][0], hi = info["value_range"][1];
  EXPECT_EQ(isovalues(store, {"--isovalue", "50%"}), (std::vector<double>{(lo + hi) / 2}));
  const std::vector<double> found = isovalues(store, {"--isovalue", "otsu,p50"});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_NEAR(found[0], 127.5, 20) << "a gyroid has as much on either side";
  EXPECT_NEAR(found[1], 127, 10);
}

TEST_F(IsovalueOption, WithoutOneTheProgramSuggestsOne) {
  const std::string store = make_store("a");
  const Outcome refused = run({"extract", store});
  expect_refused(refused, 2, {"--isovalue is missing; try --isovalue ", "Otsu's threshold"});
  // The suggestion works.
  const auto at = refused.err.find("try --isovalue ") + 15;
  const std::string value = refused.err.substr(at, refused.err.find(':', at) - at);
  EXPECT_EQ(isovalues(store, {"--isovalue", value}), isovalues(store, {"--isovalue", "otsu"}));
}

TEST_F(IsovalueOption, WhatMakesNoSense) {
  const std::string store = make_store("a");
  expect_refused(run({"extract", store, "--isovalue", "bone"}), 2, {"--isovalue", "ct-bone"});
  expect_refused(run({"extract", store, "--isovalue", "300HU"}), 2, {"Hounsfield", "-1000"});
  expect_refused(run({"extract", store, "--isovalue", "100,100"}), 2, {"given twice"});
  EXPECT_EQ(isovalues(store, {"--isovalue", "p0,0%"}).size(), 1u) << "two ways to state one";
  expect_refused(run({"export", store, path("a.vdb"), "--isovalue", "1,2"}), 2, {"one isosurface"});
}

TEST_F(IsovalueOption, TheFinestLevelThatIsSmallEnough) {
  const std::string store = make_store("a", {"--levels", "3"});
  const auto level = [&](const Arguments& more) {
    Arguments arguments{"extract", store, "--isovalue", "127.5", "-o", path("m.ply"), "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_json(arguments);
  };
  EXPECT_EQ(level({"--level", "auto"})["level"], 0);
  EXPECT_EQ(level({"--max-triangles", "100M"})["level"], 0);
  const nlohmann::json all = level({});
  const auto triangles = all["surfaces"][0]["triangles"].get<std::uint64_t>();
  const nlohmann::json fewer = level({"--max-triangles", std::to_string(triangles / 2)});
  EXPECT_EQ(fewer["level"], 1);
  EXPECT_LE(fewer["surfaces"][0]["triangles"].get<std::uint64_t>(), triangles / 2);
  EXPECT_EQ(level({"--max-triangles", "1"})["level"], 2) << "no level is coarser";
  for (const char* number : {"0", "1"})
    expect_refused(
        run({"extract", store, "--isovalue", "9", "--level", number, "--max-triangles", "9"}), 2,
        {"--level"});
  expect_refused(run({"extract", store, "--isovalue", "9", "--level", "auto", "--roi", "0:9,,"}), 2,
                 {"--region"});
}

TEST_F(IsovalueOption, ARegionOfTheWorldIsABoxOfSamples) {
  const std::string store = make_store("a");
  const auto mesh = [&](const Arguments& more) {
    Arguments arguments{"extract", store, "--isovalue", "127.5", "-o", path("m.ply"), "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    EXPECT_EQ(run(arguments).exit_code, 0);
    return read_file(path("m.ply"));
  };
  const nlohmann::json info = run_json({"info", store});
  const double spacing = info["spacing"][0], origin = info["origin"][0];
  const auto bound = [&](int sample) { return std::to_string(origin + spacing * sample); };
  const std::string region = bound(5) + ":" + bound(20) + "," + bound(0) + ":" + bound(35) + "," +
                             bound(3) + ":" + bound(9);
  EXPECT_TRUE(mesh({"--region", region}) == mesh({"--roi", "5:21,0:36,3:10"}));
  EXPECT_TRUE(mesh({"--region", ":,:" + bound(20) + ",:"}) == mesh({"--roi", ":,:21,:"}));
  EXPECT_TRUE(mesh({"--region", region, "--roi", ":,0:10,:"}) == mesh({"--roi", "5:21,0:10,3:10"}));
  ASSERT_EQ(run({"convert", store, path("part.zarr"), "--region", region}).exit_code, 0);
  EXPECT_EQ(run_json({"info", path("part.zarr")})["extent"], (nlohmann::json{16, 36, 7}));
  ASSERT_EQ(run({"export", store, path("part.raw"), "--region", region}).exit_code, 0);
  EXPECT_EQ(read_file(path("part.raw")).size(), 16u * 36 * 7);
  expect_refused(run({"extract", store, "--isovalue", "9", "--region", "900:901,0:1,0:1"}), 2,
                 {"does not touch"});
}

TEST_F(IsovalueOption, AFarFillValueIsNamedAndCanBeLeftOut) {
  std::vector<float> samples(20 * 20 * 20);
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i] = i % 20 < 3 ? -1e30F : static_cast<float>(i % 1000) / 1000;
  const std::string file = path("far_20x20x20_float32.raw");
  write_file(file, std::string(reinterpret_cast<const char*>(samples.data()),
                               samples.size() * sizeof(float)));
  const Arguments extract{"extract", file, "--isovalue", "p50", "--estimate"};
  const std::string err = run(extract).err;
  EXPECT_NE(err.find("add --nodata -1e+30"), std::string::npos) << err;
  Arguments without = extract;
  without.insert(without.end(), {"--nodata", "-1e+30"});
  const Outcome outcome = run(without);
  EXPECT_EQ(outcome.err.find("--nodata"), std::string::npos) << outcome.err;
  const std::vector<double> median = isovalues(file, {"--isovalue", "p50", "--nodata", "-1e+30"});
  ASSERT_EQ(median.size(), 1u);
  EXPECT_NEAR(median[0], 0.5, 0.05);
}

}  // namespace
}  // namespace isobrick::test

#include "tests/tools/program.h"

// The options for a store's pyramid and for its version of Zarr.
namespace isobrick::test {
namespace {

using nlohmann::json;

class PyramidOptions : public ProgramTest {
 protected:
  PyramidOptions() { write_file(path("v.raw"), noise(std::size_t{64} * 48 * 40)); }

  Outcome convert(const Arguments& more) {
    Arguments arguments{"convert",  path("v.raw"), path("v.zarr"), "--force", "--dims",
                        "64,48,40", "--type",      "u8",           "--brick", "16"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  json extents() {
    json list = json::array();
    const json info = run_json({"info", path("v.zarr")});
    for (const json& level : info["levels"]) list.push_back(level["extent"]);
    return list;
  }
};

TEST_F(PyramidOptions, FactorsAreBySpacingOrAsSaid) {
  ASSERT_EQ(convert({"--spacing", "0.4,0.4,4", "--unit", "mm"}).exit_code, 0);
  EXPECT_EQ(extents()[2], json({16, 12, 40}));
  EXPECT_EQ(run_json({"info", path("v.zarr")})["unit"], "millimeter");
  EXPECT_NE(read_file(path("v.zarr/zarr.json")).find("\"millimeter\""), std::string::npos);
  ASSERT_EQ(convert({"--factors", "1,2,2", "--factors", "2,1,1", "--levels", "4"}).exit_code, 0);
  EXPECT_EQ(extents(), json({{64, 48, 40}, {64, 24, 20}, {32, 24, 20}, {16, 24, 20}}));
  EXPECT_EQ(
      run({"extract", path("v.zarr"), "--isovalue", "100", "--level", "3", "-o", path("m.ply")})
          .exit_code,
      0);
  EXPECT_EQ(run({"verify", path("v.zarr")}).exit_code, 0);
  expect_refused(convert({"--factors", "4,1,1"}), 2, {"4,1,1", "1 or 2"});
  expect_refused(convert({"--unit", "furlong"}), 2, {"furlong", "micrometer", "parsec"});
}

TEST_F(PyramidOptions, TheMethodIsSaid) {
  std::string highest[2];
  for (const char* method : {"max", "min"}) {
    ASSERT_EQ(convert({"--downsample", method}).exit_code, 0);
    ASSERT_EQ(run({"export", path("v.zarr"), path("l.raw"), "--level", "1", "--force"}).exit_code,
              0);
    highest[method[1] == 'i'] = read_file(path("l.raw"));
  }
  ASSERT_EQ(highest[0].size(), std::size_t{32} * 24 * 20);
  // Of eight random samples.
  EXPECT_GT(static_cast<unsigned char>(highest[0][0]), static_cast<unsigned char>(highest[1][0]));
  expect_refused(convert({"--downsample", "median"}), 2, {"median", "mode"});
}

TEST_F(PyramidOptions, OmeZarr04IsWrittenAndWorkedOn) {
  ASSERT_EQ(convert({"--ome", "0.4", "--build-index", "octree"}).exit_code, 0);
  EXPECT_NE(read_file(path("v.zarr/.zattrs")).find("\"0.4\""), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(path("v.zarr/zarr.json")));
  EXPECT_EQ(run_json({"info", path("v.zarr")})["index_kinds"], json({"octree"}));
  EXPECT_EQ(run({"index", path("v.zarr"), "--kind", "interval"}).exit_code, 0);
  EXPECT_EQ(run({"verify", path("v.zarr")}).exit_code, 0);
  const Outcome mesh =
      run({"extract", path("v.zarr"), "--isovalue", "100", "-o", path("a.ply"), "--level", "1"});
  EXPECT_EQ(mesh.exit_code, 0) << mesh.err;
  ASSERT_EQ(convert({}).exit_code, 0);
  run({"extract", path("v.zarr"), "--isovalue", "100", "-o", path("b.ply"), "--level", "1"});
  EXPECT_TRUE(read_file(path("a.ply")) == read_file(path("b.ply")));
  expect_refused(convert({"--ome", "0.6"}), 2, {"0.6", "0.4 or 0.5"});
}

}  // namespace
}  // namespace isobrick::test

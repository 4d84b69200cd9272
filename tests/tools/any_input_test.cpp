#include <cstring>

#include "tests/tools/program.h"

// Commands that read a volume take any input, and make of it what they make of its store.
namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class AnyInput : public ProgramTest {
 protected:
  /// 40 x 36 x 33 samples as a raw file with its description in its name.
  std::string raw() {
    const std::string file = path("scan_40x36x33_uint8.raw");
    if (!fs::exists(file)) {
      EXPECT_EQ(
          run({"synth", "gyroid", path("g.raw"), "--dims", "40,36,33", "--type", "u8"}).exit_code,
          0);
      fs::rename(path("g.raw"), file);
    }
    return file;
  }
  std::string nrrd() {
    EXPECT_EQ(run({"export", raw(), path("scan.nrrd"), "--spacing", "1,2,3"}).exit_code, 0);
    return path("scan.nrrd");
  }
  std::string mesh(const std::string& input, const Arguments& more = {}) {
    Arguments arguments{"extract", input, "--isovalue", "127.5", "-o", path("m.ply"), "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    err_ = outcome.err;
    return read_file(path("m.ply"));
  }

  std::string err_;
};

TEST_F(AnyInput, AMeshIsThatOfTheConvertedStore) {
  for (const std::string& input : {raw(), nrrd()}) {
    ASSERT_EQ(run({"convert", input, path("a.zarr"), "--force"}).exit_code, 0);
    const std::string expected = mesh(path("a.zarr"));
    EXPECT_EQ(err_, "");
    EXPECT_TRUE(mesh(input) == expected);
    EXPECT_NE(err_.find("converting '" + input + "' into the cache"), std::string::npos) << err_;
    EXPECT_TRUE(mesh(input) == expected);
    EXPECT_EQ(err_, "") << "the store was kept";
    EXPECT_TRUE(mesh(input, {"--cache", "none"}) == expected);
    EXPECT_NE(err_.find("temporary store"), std::string::npos) << err_;
  }
}

TEST_F(AnyInput, TheConversionIsAnnouncedBeforeItBegins) {
  const Arguments extract{"extract", nrrd(), "--isovalue", "127.5", "-o", path("m.ply"), "--force"};
  const auto with = [&](const Arguments& more) {
    Arguments arguments = extract;
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  };
  const std::string err = run(with({"--progress", "lines"})).err;
  const std::size_t note = err.find("converting '" + path("scan.nrrd") + "' into the cache");
  ASSERT_NE(note, std::string::npos) << err;
  EXPECT_LT(note, err.find(" %")) << err;
  EXPECT_EQ(err.find("converting", note + 1), std::string::npos) << err;
  EXPECT_EQ(run(with({"--spacing", "1,1,1", "--quiet"})).err, "");
}

TEST_F(AnyInput, ExportInfoAndView) {
  const std::string input = nrrd();
  ASSERT_EQ(run({"convert", input, path("a.zarr")}).exit_code, 0);
  ASSERT_EQ(run({"export", input, path("x.raw")}).exit_code, 0);
  ASSERT_EQ(run({"export", path("a.zarr"), path("y.raw")}).exit_code, 0);
  EXPECT_TRUE(read_file(path("x.raw")) == read_file(path("y.raw")));
  const nlohmann::json info = run_json({"info", input});
  EXPECT_EQ(info["extent"], (nlohmann::json{40, 36, 33}));
  EXPECT_EQ(info["spacing"], (nlohmann::json{1, 2, 3}));
  EXPECT_EQ(info["format"], "NRRD");
  EXPECT_TRUE(info["histogram"].is_null()) << "no sample is read";
  EXPECT_EQ(run_json({"info", input, "--stats"})["histogram"],
            run_json({"info", path("a.zarr"), "--stats"})["histogram"]);
  if (run({"help", "view"}).out.find("not in this program") != std::string::npos) return;
  for (const std::string& volume : {input, path("a.zarr")})
    ASSERT_EQ(run({"view", volume, "--screenshot", volume + ".png", "--size", "160x120"}).exit_code,
              0);
  EXPECT_TRUE(read_file(input + ".png") == read_file(path("a.zarr.png")));
}

TEST_F(AnyInput, RawSamplesNeedTheirDescription) {
  fs::rename(raw(), path("scan.raw"));
  expect_refused(run({"extract", path("scan.raw"), "--isovalue", "1"}), 2, {"--dims", "--type"});
  EXPECT_EQ(run({"extract", path("scan.raw"), "--isovalue", "127.5", "-o", path("a.ply"), "--dims",
                 "40,36,33", "--type", "u8"})
                .exit_code,
            0);
}

TEST_F(AnyInput, StridesAndMissingSamples) {
  ASSERT_EQ(run({"convert", raw(), path("half.zarr"), "--stride", "2"}).exit_code, 0);
  EXPECT_EQ(run_json({"info", path("half.zarr")})["extent"], (nlohmann::json{20, 18, 17}));
  EXPECT_EQ(run_json({"info", path("half.zarr")})["spacing"], (nlohmann::json{2, 2, 2}));
  EXPECT_TRUE(mesh(raw(), {"--stride", "2"}) == mesh(path("half.zarr")));
  // A mesh around holes has other triangles, none of which touches a missing sample.
  const std::string whole = mesh(raw());
  EXPECT_LT(mesh(raw(), {"--nodata", "130"}).size(), whole.size());
  EXPECT_TRUE(mesh(raw(), {"--nodata", "1000"}) == whole) << "the same samples as floats";
}

TEST_F(AnyInput, OutputsAreCheckedBeforeAConversion) {
  write_file(path("m.ply"), "mine");
  for (const Arguments& arguments :
       {Arguments{"extract", raw(), "--isovalue", "127.5", "-o", path("m.ply")},
        Arguments{"extract", raw(), "--isovalue", "127.5", "-o", path("none/m.ply")},
        Arguments{"export", raw(), path("m.ply"), "--format", "raw"},
        Arguments{"export", raw(), path("none/m.raw")}}) {
    const Outcome outcome = run(arguments);
    EXPECT_NE(outcome.exit_code, 0);
    EXPECT_EQ(outcome.err.find("converting"), std::string::npos) << outcome.err;
  }
  EXPECT_EQ(read_file(path("m.ply")), "mine");
}

TEST_F(AnyInput, RegionsCountWhatAStrideLeaves) {
  const Arguments part{"--stride", "2", "--roi", "3:15,0:18,2:9"};
  Arguments convert{"convert", raw(), path("part.zarr")};
  convert.insert(convert.end(), part.begin(), part.end());
  ASSERT_EQ(run(convert).exit_code, 0);
  EXPECT_EQ(run_json({"info", path("part.zarr")})["extent"], (nlohmann::json{12, 18, 7}));
  Arguments extract{"extract", raw(), "--isovalue", "127.5", "--estimate"};
  extract.insert(extract.end(), part.begin(), part.end());
  EXPECT_EQ(run(extract).exit_code, 0);
}

TEST_F(AnyInput, AFolderOfSlicesThatAlsoHoldsAStore) {
  expect_refused(run({"extract", path(""), "--isovalue", "1"}), 2, {});
  const std::string store = make_store("inside");
  expect_refused(run({"extract", path(""), "--isovalue", "1"}), 1, {"holds Zarr", "inside.zarr"});
}

TEST_F(AnyInput, ALimitOfTheCache) {
  mesh(raw(), {"--cache", path("kept"), "--cache-limit", "1"});
  mesh(raw(), {"--stride", "2", "--cache", path("kept"), "--cache-limit", "1"});
  std::size_t stores = 0;
  for (const auto& entry : fs::directory_iterator(path("kept")))
    stores += fs::exists(entry.path() / "store.zarr") ? 1 : 0;
  EXPECT_EQ(stores, 1u);
}

TEST_F(AnyInput, WhatIsNoVolume) {
  expect_refused(run({"extract", path("none.nrrd"), "--isovalue", "1"}), 1, {"does not exist"});
  write_file(path("m.ply"), "ply\n");
  expect_refused(run({"extract", path("m.ply"), "--isovalue", "1"}), 1,
                 {"is no volume", "isobrick render"});
  write_file(path("p.png"), "x");
  expect_refused(run({"info", path("p.png")}), 1, {"is no volume", "picture"});
  fs::create_directory(path("empty"));
  EXPECT_NE(run({"extract", path("empty"), "--isovalue", "1"}).exit_code, 0);
  write_file(path("a.nrrd"), "NRRD0004\ngarbage\n");
  EXPECT_NE(run({"extract", path("a.nrrd"), "--isovalue", "1"}).exit_code, 0);
  EXPECT_EQ(files(), (std::vector<std::string>{"a.nrrd", "empty", "m.ply", "p.png"}));
}

TEST_F(AnyInput, OutputsHaveTheInputsName) {
  const std::string command = "cd '" + path("") + "' && '" ISOBRICK_PROGRAM "' ";
  const auto in_folder = [&](const std::string& words) {
    const Outcome outcome = run_process({"bash", "-c", command + words});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.out;
  };
  fs::create_directory(path("in"));
  fs::rename(nrrd(), path("in/scan.nrrd"));
  in_folder("convert in/scan.nrrd");
  EXPECT_NE(in_folder("extract scan.zarr --isovalue 127.5").find("scan_127.5.ply"),
            std::string::npos);
  in_folder("extract in/scan.nrrd --isovalue 100,150 --format glb");
  in_folder("export scan.zarr");
  in_folder("synth sphere --dims 9,9,9 --type u8");
  for (const char* name :
       {"scan.zarr", "scan_127.5.ply", "scan_100.glb", "scan_150.glb", "scan.nrrd", "sphere.zarr"})
    EXPECT_TRUE(fs::exists(path(name))) << name;
  expect_refused(run_process({"bash", "-c", command + "convert in/scan.nrrd"}), 2, {"--force"});
  in_folder("extract scan.zarr --isovalue 127.5 --estimate");
  expect_refused(run({"convert", path("in/scan.nrrd"), path("a.zarr"), "-o", path("b.zarr")}), 2,
                 {"two outputs"});
}

}  // namespace
}  // namespace isobrick::test

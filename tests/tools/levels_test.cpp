#include <algorithm>
#include <filesystem>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

Arguments joined(Arguments words, const Arguments& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// `extract --format neuroglancer`.
class MeshLevels : public ProgramTest {
 protected:
  MeshLevels() : store_(make_store("a")) {}

  void SetUp() override {
    const Outcome made = run(extract({"--format", "neuroglancer", "-o", path("probe")}));
    if (made.err.find("libdraco-dev") != std::string::npos) GTEST_SKIP() << made.err;
    EXPECT_EQ(made.exit_code, 0) << made.err;
    fs::remove_all(path("probe"));
  }

  Arguments extract(const Arguments& more) const {
    Arguments words{"extract", store_, "--isovalue", "127.5"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  /// Everything in an output: names and bytes.
  std::string content(const std::string& name) const {
    std::vector<std::string> parts;
    for (const auto& entry : fs::recursive_directory_iterator(path(name)))
      if (entry.is_regular_file())
        parts.push_back(fs::relative(entry.path(), path(name)).string() + "\n" +
                        read_file(entry.path().string()));
    std::sort(parts.begin(), parts.end());
    std::string all;
    for (const std::string& part : parts) all += part;
    return all;
  }
  std::uint64_t size_of(const std::string& name) const {
    std::uint64_t bytes = 0;
    for (const auto& entry : fs::recursive_directory_iterator(path(name)))
      if (entry.is_regular_file()) bytes += entry.file_size();
    return bytes;
  }

  std::string store_;
};

TEST_F(MeshLevels, AreAFolderOfTheMesh) {
  const nlohmann::json made = run_json(extract({"-o", path("m.neuroglancer/")}))["surfaces"][0];
  const nlohmann::json ply = run_json(extract({"-o", path("m.ply")}))["surfaces"][0];
  EXPECT_EQ(made["triangles"], ply["triangles"]);
  EXPECT_EQ(made["vertices"], ply["vertices"]);
  EXPECT_EQ(made["output_bytes"], size_of("m.neuroglancer"));
  ASSERT_EQ(made["levels"].size(), 1U);
  EXPECT_EQ(made["levels"][0]["triangles"], made["triangles"]);
  EXPECT_EQ(made["levels"][0]["fragments"], 1);
  EXPECT_EQ(made["levels"][0]["bytes"], fs::file_size(path("m.neuroglancer/1")));
  EXPECT_FALSE(ply.contains("levels"));
  for (const char* name : {"info", "1", "1.index", "segment_properties/info"})
    EXPECT_TRUE(fs::is_regular_file(path("m.neuroglancer") + "/" + name)) << name;
  EXPECT_EQ(files(), (std::vector<std::string>{"a.zarr", "m.neuroglancer", "m.ply"}));
}

TEST_F(MeshLevels, ThreadsAndMemoryNeverShow) {
  const auto made = [&](const Arguments& more) {
    Arguments words = extract({"-o", path("m.neuroglancer"), "--force"});
    words.insert(words.end(), more.begin(), more.end());
    EXPECT_EQ(run(words).exit_code, 0);
    return content("m.neuroglancer");
  };
  const std::string first = made({"--levels", "3"});
  EXPECT_TRUE(made({"--levels", "3", "--threads", "1", "--memory", "200M"}) == first);
  EXPECT_TRUE(made({"--levels", "3", "--threads", "3", "--memory", "4G"}) == first);
  EXPECT_FALSE(made({"--levels", "2"}) == first);
  EXPECT_EQ(made({"--levels", "1"}), made({})) << "one part has all of a small mesh";
}

TEST_F(MeshLevels, AFolderOfEachIsovalue) {
  const Outcome made = run({"extract", store_, "--isovalue", "100,127.5", "-o",
                            path("m.neuroglancer"), "--levels", "2"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  ASSERT_EQ(
      run(extract({"-o", path("one"), "--format", "neuroglancer", "--levels", "2"})).exit_code, 0);
  EXPECT_EQ(read_file(path("m_127.5.neuroglancer/1")), read_file(path("one/1")));
  EXPECT_NE(made.out.find("2 levels of detail"), std::string::npos) << made.out;
  EXPECT_TRUE(fs::exists(path("m_100.neuroglancer/info")));
}

TEST_F(MeshLevels, OfLabelsAreOneFolder) {
  ASSERT_EQ(run({"synth", "cells", path("c.zarr"), "--dims", "60,50,40", "--type", "u8"}).exit_code,
            0);
  const auto made = [&](const Arguments& more) {
    Arguments words{"extract", path("c.zarr"),         "--labels", "3:9",
                    "-o",      path("c.neuroglancer"), "--force"};
    words.insert(words.end(), more.begin(), more.end());
    const nlohmann::json json = run_json(words);
    EXPECT_EQ(json["labels"], 7);
    EXPECT_EQ(json["output_bytes"], size_of("c.neuroglancer"));
    return content("c.neuroglancer");
  };
  const std::string first = made({});
  for (const char* name : {"info", "3", "3.index", "9", "9.index", "labels.json"})
    EXPECT_TRUE(fs::exists(path("c.neuroglancer") + "/" + name)) << name;
  EXPECT_TRUE(made({"--threads", "1"}) == first);
  const std::string sharded = made({"--sharded"});
  EXPECT_TRUE(fs::exists(path("c.neuroglancer/0.shard")));
  EXPECT_FALSE(fs::exists(path("c.neuroglancer/3")));
  EXPECT_TRUE(made({"--sharded", "--threads", "1", "--memory", "250M"}) == sharded);
}

TEST_F(MeshLevels, NamesAndColoursOfLabelsAreSegmentProperties) {
  write_file(path("seg.nrrd"),
             "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n"
             "Segment0_ID:=A\nSegment0_Name:=Liver\nSegment0_LabelValue:=1\n"
             "Segment0_Color:=1 0.5 0\nSegment0_Layer:=0\n\n" +
                 std::string(42, '\0') + std::string(2, '\1') + std::string(20, '\0'));
  ASSERT_EQ(run({"convert", path("seg.nrrd"), path("seg.zarr")}).exit_code, 0);
  const Outcome made = run({"extract", path("seg.zarr"), "--labels", "all", "-o", path("seg"),
                            "--format", "neuroglancer"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const nlohmann::json properties =
      nlohmann::json::parse(read_file(path("seg/segment_properties/info")))["inline"];
  EXPECT_EQ(properties["ids"], nlohmann::json({"1"}));
  EXPECT_EQ(properties["properties"][0]["type"], "label");
  EXPECT_EQ(properties["properties"][0]["values"], nlohmann::json({"Liver"}));
  EXPECT_EQ(properties["properties"][1]["type"], "string");
  EXPECT_EQ(properties["properties"][1]["values"], nlohmann::json({"#ff8000"}));
}

TEST_F(MeshLevels, RefuseWhatMakesNoSense) {
  const auto refuse = [&](const Arguments& more, std::initializer_list<std::string> words) {
    const std::vector<std::string> before = files();
    expect_refused(run(extract(more)), 2, words);
    EXPECT_EQ(files(), before);
  };
  refuse({"-o", "-", "--format", "neuroglancer"}, {"standard output", "folder"});
  refuse({"-o", path("m.ply"), "--levels", "2"}, {"--levels", "PLY", "--format neuroglancer"});
  refuse({"-o", path("m.ply"), "--sharded"}, {"--sharded", "PLY"});
  refuse({"-o", path("m.neuroglancer"), "--levels", "0"}, {"--levels", "'0'"});
  refuse({"-o", path("m.neuroglancer"), "--levels", "17"}, {"--levels", "'17'", "16"});
  refuse({"-o", path("m.neuroglancer"), "--quantize"}, {"--quantize", "GLB"});
  refuse({"-o", path("m.ply"), "--format", "neuroglancer"}, {"m.ply"});
  refuse({"-o", path("m.neuroglancer"), "--format", "ply"}, {"m.neuroglancer"});
  refuse({"-o", path("m.neuroglancer"), "--memory", "100M"}, {"--memory"});
  const Arguments labels{"extract", store_, "--labels", "all"};
  expect_refused(run(joined(labels, {"-o", path("m"), "--levels", "2"})), 2,
                 {"--levels", "--format neuroglancer"});
  expect_refused(run(joined(labels, {"-o", path("m.neuroglancer"), "--memory", "150M"})), 2,
                 {"--memory"});
}

TEST_F(MeshLevels, KeepWhatIsNotTheirs) {
  fs::create_directory(path("mine"));
  write_file(path("mine/notes.txt"), "mine");
  const Arguments to_mine{"-o", path("mine"), "--format", "neuroglancer"};
  expect_refused(run(extract(to_mine)), 2, {"mine", "exists already"});
  expect_refused(run(extract(joined(to_mine, {"--force"}))), 2, {"notes.txt"});
  EXPECT_EQ(read_file(path("mine/notes.txt")), "mine");
  write_file(path("file"), "mine");
  expect_refused(run(extract({"-o", path("file"), "--format", "neuroglancer", "--force"})), 2,
                 {"file", "no folder"});
  EXPECT_EQ(read_file(path("file")), "mine");
}

TEST_F(MeshLevels, NegativeLabelsAreRefused) {
  std::string samples(64, '\0');
  samples[21] = '\xfd';
  write_file(path("s.raw"), samples);
  ASSERT_EQ(
      run({"convert", path("s.raw"), path("s.zarr"), "--dims", "4,4,4", "--type", "i8"}).exit_code,
      0);
  expect_refused(run({"extract", path("s.zarr"), "--labels", "all", "-o", path("s.neuroglancer")}),
                 2, {"-3", "neuroglancer"});
  EXPECT_FALSE(fs::exists(path("s.neuroglancer")));
}

TEST_F(MeshLevels, AFullDiskLeavesNothing) {
  const std::vector<std::string> before = files();
  for (const char* after : {"0", "3000"})
    for (const Arguments& more : {Arguments{}, Arguments{"--sharded"}}) {
      Arguments words{"env",
                      "LD_PRELOAD=" ISOBRICK_WRITE_FAULT,
                      std::string("ISOBRICK_FAULT_AFTER=") + after,
                      "ISOBRICK_FAULT_ERRNO=28",
                      "ISOBRICK_FAULT_SIGNAL=0",
                      "ASAN_OPTIONS=verify_asan_link_order=0",
                      ISOBRICK_PROGRAM};
      const Arguments command =
          joined(extract({"-o", path("m.neuroglancer"), "--no-space-check"}), more);
      words.insert(words.end(), command.begin(), command.end());
      expect_refused(run_process(words), 1, {"No space left"});
      EXPECT_EQ(files(), before);
    }
}

}  // namespace
}  // namespace isobrick::test

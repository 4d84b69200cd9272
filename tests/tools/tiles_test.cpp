#include <algorithm>
#include <filesystem>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// `extract --format 3dtiles`.
class TilesCommand : public ProgramTest {
 protected:
  TilesCommand() : store_(make_store("a")) {}

  Arguments extract(const Arguments& more) const {
    Arguments words{"extract", store_, "--isovalue", "127.5"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  /// Names of all files in an output, sorted, each with its bytes.
  std::vector<std::pair<std::string, std::string>> content(const std::string& name) const {
    std::vector<std::pair<std::string, std::string>> found;
    for (const auto& entry : fs::recursive_directory_iterator(path(name)))
      if (entry.is_regular_file())
        found.emplace_back(fs::relative(entry.path(), path(name)).string(),
                           read_file(entry.path().string()));
    std::sort(found.begin(), found.end());
    return found;
  }
  std::uint64_t size_of(const std::string& name) const {
    std::uint64_t bytes = 0;
    for (const auto& [file, text] : content(name)) bytes += text.size();
    return bytes;
  }
  nlohmann::json tileset(const std::string& name) const {
    return nlohmann::json::parse(read_file(path(name + "/tileset.json")));
  }

  std::string store_;
};

TEST_F(TilesCommand, IsAFolderOfTheMesh) {
  const nlohmann::json made =
      run_json(extract({"-o", path("m.3dtiles/"), "--levels", "3"}))["surfaces"][0];
  const nlohmann::json ply = run_json(extract({"-o", path("m.ply")}))["surfaces"][0];
  EXPECT_EQ(made["triangles"], ply["triangles"]);
  EXPECT_EQ(made["vertices"], ply["vertices"]);
  EXPECT_EQ(made["output_bytes"], size_of("m.3dtiles"));
  ASSERT_EQ(made["levels"].size(), 3U);
  std::uint64_t files_of_levels = 0;
  for (int level = 0; level < 3; ++level) {
    std::uint64_t bytes = 0, fragments = 0;
    for (const auto& [file, text] : content("m.3dtiles"))
      if (file.starts_with(std::to_string(level) + "/")) bytes += text.size(), ++fragments;
    EXPECT_EQ(made["levels"][level]["bytes"], bytes);
    EXPECT_EQ(made["levels"][level]["fragments"], fragments);
    files_of_levels += fragments;
  }
  EXPECT_EQ(content("m.3dtiles").size(), files_of_levels + 1);
  EXPECT_EQ(tileset("m.3dtiles")["asset"]["version"], "1.1");
  EXPECT_EQ(files(), (std::vector<std::string>{"a.zarr", "m.3dtiles", "m.ply"}));
}

TEST_F(TilesCommand, ThreadsAndMemoryNeverShow) {
  const auto made = [&](const Arguments& more) {
    Arguments words = extract({"-o", path("m.3dtiles"), "--force"});
    words.insert(words.end(), more.begin(), more.end());
    EXPECT_EQ(run(words).exit_code, 0);
    return content("m.3dtiles");
  };
  const auto first = made({"--levels", "3"});
  EXPECT_TRUE(made({"--levels", "3", "--threads", "1", "--memory", "200M"}) == first);
  EXPECT_TRUE(made({"--levels", "3", "--threads", "3", "--memory", "4G"}) == first);
  EXPECT_FALSE(made({"--levels", "2"}) == first);
  const auto plain = made({"--levels", "3", "--normals", "none"});
  ASSERT_EQ(plain.size(), first.size());
  EXPECT_LT(plain.front().second.size(), first.front().second.size());
  EXPECT_NE(first.front().second.find("NORMAL"), std::string::npos);
  EXPECT_EQ(plain.front().second.find("NORMAL"), std::string::npos);
}

TEST_F(TilesCommand, OfEachIsovalue) {
  const Outcome made =
      run({"extract", store_, "--isovalue", "100,127.5", "-o", path("m.3dtiles"), "--levels", "2"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  ASSERT_EQ(run(extract({"-o", path("one"), "--format", "3dtiles", "--levels", "2"})).exit_code, 0);
  EXPECT_EQ(content("m_127.5.3dtiles"), content("one"));
  EXPECT_NE(made.out.find("2 levels of detail"), std::string::npos) << made.out;
  EXPECT_TRUE(fs::exists(path("m_100.3dtiles/tileset.json")));
}

TEST_F(TilesCommand, OfLabelsAreATilesetEach) {
  ASSERT_EQ(run({"synth", "cells", path("c.zarr"), "--dims", "60,50,40", "--type", "u8"}).exit_code,
            0);
  const auto made = [&](const Arguments& more) {
    Arguments words{"extract", path("c.zarr"),    "--labels", "3:9",
                    "-o",      path("c.3dtiles"), "--force"};
    words.insert(words.end(), more.begin(), more.end());
    const nlohmann::json json = run_json(words);
    EXPECT_EQ(json["labels"], 7);
    EXPECT_EQ(json["output_bytes"], size_of("c.3dtiles"));
    return content("c.3dtiles");
  };
  const auto first = made({});
  EXPECT_TRUE(made({"--threads", "1", "--memory", "250M"}) == first);
  const nlohmann::json root = tileset("c.3dtiles")["root"],
                       list = nlohmann::json::parse(read_file(path("c.3dtiles/labels.json")));
  ASSERT_EQ(root["children"].size(), 7U);
  for (std::size_t i = 0; i < 7; ++i) {
    const std::string uri = std::to_string(3 + i) + "/tileset.json";
    EXPECT_EQ(root["children"][i]["content"]["uri"], uri);
    EXPECT_EQ(list["labels"][i]["file"], uri);
    const nlohmann::json own = tileset("c.3dtiles/" + std::to_string(3 + i));
    EXPECT_EQ(root["children"][i]["geometricError"], own["geometricError"]);
    EXPECT_LE(own["geometricError"], root["geometricError"]);
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(root["children"][i]["boundingVolume"]["box"][axis].get<double>(),
                  own["root"]["boundingVolume"]["box"][axis].get<double>() +
                      own["root"]["transform"][12 + axis].get<double>(),
                  1e-9);
  }
}

TEST_F(TilesCommand, LabelsMayBeNegativeAndHaveColours) {
  std::string samples(64, '\0');
  samples[21] = '\xfd';
  write_file(path("s.raw"), samples);
  ASSERT_EQ(
      run({"convert", path("s.raw"), path("s.zarr"), "--dims", "4,4,4", "--type", "i8"}).exit_code,
      0);
  const Arguments negative{"extract", path("s.zarr"), "--labels", "all", "-o", path("s.3dtiles")};
  ASSERT_EQ(run(negative).exit_code, 0);
  EXPECT_TRUE(fs::exists(path("s.3dtiles/-3/0/0_0_0.glb")));
  Arguments again = negative;
  again.push_back("--force");
  EXPECT_EQ(run(again).exit_code, 0);
  write_file(path("seg.nrrd"),
             "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n"
             "Segment0_ID:=A\nSegment0_Name:=Liver\nSegment0_LabelValue:=1\n"
             "Segment0_Color:=1 0.5 0\nSegment0_Layer:=0\n\n" +
                 std::string(42, '\0') + std::string(2, '\1') + std::string(20, '\0'));
  ASSERT_EQ(run({"convert", path("seg.nrrd"), path("seg.zarr")}).exit_code, 0);
  const Outcome made = run(
      {"extract", path("seg.zarr"), "--labels", "all", "-o", path("seg"), "--format", "3dtiles"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const std::string glb = read_file(path("seg/1/0/0_0_0.glb"));
  EXPECT_NE(glb.find("\"baseColorFactor\":[1.0,0.2159,0.0,1]"), std::string::npos)
      << "linear light";
  EXPECT_NE(glb.find("NORMAL"), std::string::npos);
  ASSERT_EQ(run({"extract", path("seg.zarr"), "--labels", "all", "-o", path("flat"), "--format",
                 "3dtiles", "--normals", "none"})
                .exit_code,
            0);
  EXPECT_EQ(read_file(path("flat/1/0/0_0_0.glb")).find("NORMAL"), std::string::npos);
}

TEST_F(TilesCommand, AreCompressedOnRequest) {
#ifdef ISOBRICK_WITH_MESHOPT
  ASSERT_EQ(run({"synth", "cells", path("c.zarr"), "--dims", "60,50,40", "--type", "u8"}).exit_code,
            0);
  const Arguments commands[] = {
      extract({"-o", path("m.3dtiles")}),
      {"extract", path("c.zarr"), "--labels", "3:9", "-o", path("m.3dtiles")}};
  for (Arguments words : commands) {
    ASSERT_EQ(run(words).exit_code, 0);
    const auto plain = content("m.3dtiles");
    words.insert(words.end(), {"--compress", "--force"});
    const nlohmann::json made = run_json(words);
    const auto packed = content("m.3dtiles");
    EXPECT_EQ(
        made.contains("surfaces") ? made["surfaces"][0]["output_bytes"] : made["output_bytes"],
        size_of("m.3dtiles"));
    ASSERT_EQ(packed.size(), plain.size());
    for (std::size_t i = 0; i < packed.size(); ++i) {
      EXPECT_EQ(packed[i].first, plain[i].first);
      if (!packed[i].first.ends_with(".glb")) continue;
      EXPECT_LT(packed[i].second.size(), plain[i].second.size());
      EXPECT_NE(packed[i].second.find("EXT_meshopt_compression"), std::string::npos);
    }
    fs::remove_all(path("m.3dtiles"));
  }
#else
  expect_refused(run(extract({"-o", path("m.3dtiles"), "--compress"})), 2, {"meshoptimizer"});
  EXPECT_EQ(files(), (std::vector<std::string>{"a.zarr"}));
#endif
}

TEST_F(TilesCommand, RefuseWhatMakesNoSense) {
  const auto refuse = [&](const Arguments& more, std::initializer_list<std::string> words) {
    const std::vector<std::string> before = files();
    expect_refused(run(extract(more)), 2, words);
    EXPECT_EQ(files(), before);
  };
  const std::string output = path("m.3dtiles");
  refuse({"-o", "-", "--format", "3dtiles"}, {"standard output", "folder"});
  refuse({"-o", output, "--levels", "0"}, {"--levels", "'0'"});
  refuse({"-o", output, "--levels", "17"}, {"--levels", "'17'", "16"});
  refuse({"-o", output, "--levels", "many"}, {"--levels", "'many'"});
  refuse({"-o", output, "--sharded"}, {"--sharded", "neuroglancer", "3D Tiles"});
  refuse({"-o", output, "--quantize"}, {"--quantize", "GLB"});
  refuse({"-o", path("m.neuroglancer"), "--compress"}, {"--compress", "GLB and 3D Tiles"});
  refuse({"-o", output, "--attribute", "heat=" + store_}, {"--attribute", "3D Tiles"});
  refuse({"-o", output, "--part", "1/2"}, {"--part", "3dtiles"});
  refuse({"-o", path("m.ply"), "--format", "3dtiles"}, {"m.ply"});
  refuse({"-o", output, "--format", "ply"}, {"m.3dtiles"});
  refuse({"-o", output, "--memory", "100M"}, {"--memory"});
  refuse({"-o", path("m.ply"), "--levels", "2"}, {"--levels", "PLY", "neuroglancer or 3dtiles"});
  refuse({"-o", path("m.tiles")}, {".3dtiles"});
  const Arguments labels{"extract", store_, "--labels", "all", "-o", output};
  for (const Arguments& more : {Arguments{"--sharded"}, {"--normals", "gradient"}}) {
    Arguments words = labels;
    words.insert(words.end(), more.begin(), more.end());
    expect_refused(run(words), 2, {more.front()});
  }
}

TEST_F(TilesCommand, KeepsWhatIsNotItsOwn) {
  fs::create_directory(path("mine"));
  write_file(path("mine/notes.txt"), "mine");
  const Arguments to_mine = extract({"-o", path("mine"), "--format", "3dtiles"});
  expect_refused(run(to_mine), 2, {"mine", "exists already"});
  Arguments forced = to_mine;
  forced.push_back("--force");
  expect_refused(run(forced), 2, {"notes.txt"});
  EXPECT_EQ(read_file(path("mine/notes.txt")), "mine");
}

TEST_F(TilesCommand, AFullDiskLeavesNothing) {
  const std::vector<std::string> before = files();
  for (const char* after : {"0", "3000", "200000"}) {
    Arguments words{"env",
                    "LD_PRELOAD=" ISOBRICK_WRITE_FAULT,
                    std::string("ISOBRICK_FAULT_AFTER=") + after,
                    "ISOBRICK_FAULT_ERRNO=28",
                    "ISOBRICK_FAULT_SIGNAL=0",
                    "ASAN_OPTIONS=verify_asan_link_order=0",
                    ISOBRICK_PROGRAM};
    const Arguments command = extract({"-o", path("m.3dtiles"), "--no-space-check"});
    words.insert(words.end(), command.begin(), command.end());
    expect_refused(run_process(words), 1, {"No space left"});
    EXPECT_EQ(files(), before);
  }
}

}  // namespace
}  // namespace isobrick::test

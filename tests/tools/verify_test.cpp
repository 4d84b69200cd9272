#include <unistd.h>

#include <filesystem>

#include "tests/tools/program.h"

// What `verify` cannot look at, and what it and `info` take.
namespace isobrick::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

class VerifyCommand : public ProgramTest {
 protected:
  static void expect_not_whole(const std::string& store, const std::string& why) {
    const Outcome outcome = run({"verify", store});
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_EQ(outcome.out.find("is whole"), std::string::npos) << outcome.out;
    EXPECT_NE(outcome.out.find(why), std::string::npos) << outcome.out << outcome.err;
  }

  /// An array of u8 of another program; none of its chunks is there, so that all samples are 0.
  std::string write_array(const std::string& name, int edge, int chunk) const {
    fs::create_directory(path(name));
    json array{{"zarr_format", 3},
               {"node_type", "array"},
               {"shape", {edge, edge, edge}},
               {"fill_value", 0},
               {"data_type", "uint8"}};
    array["chunk_grid"] = {{"name", "regular"},
                           {"configuration", {{"chunk_shape", {chunk, chunk, chunk}}}}};
    array["chunk_key_encoding"] = {{"name", "default"}};
    array["codecs"] = {{{"name", "bytes"}, {"configuration", {{"endian", "little"}}}}};
    write_file(path(name) + "/zarr.json", array.dump());
    return path(name);
  }
};

TEST_F(VerifyCommand, AnIndexThatIsGoneIsDamage) {
  const std::string store = make_store("a", {"--build-index", "octree"});
  ASSERT_EQ(run({"verify", store}).exit_code, 0);
  const std::string folder = store + "/isobrick/0/index/octree";
  fs::rename(folder + "/index.json", path("kept"));
  expect_not_whole(store, "there is no '" + folder + "/index.json'");
  fs::rename(path("kept"), folder + "/index.json");
  ASSERT_EQ(run({"verify", store}).exit_code, 0);
  fs::remove_all(store + "/isobrick/1/index");
  expect_not_whole(store, "level 1: its octree index is gone");
  EXPECT_EQ(run({"index", store, "--kind", "octree", "--force"}).exit_code, 0);
  EXPECT_EQ(run({"verify", store}).exit_code, 0);
}

TEST_F(VerifyCommand, AFolderThatCannotBeReadIsDamage) {
  const std::string store = make_store("a");
  const fs::path folder = store + "/isobrick/0/index";
  // Nobody can follow it, root neither.
  fs::create_symlink("index", folder);
  expect_not_whole(store, "cannot look into the folder '" + folder.string());
  fs::remove(folder);
  if (geteuid() == 0) return;
  fs::create_directory(folder);
  fs::permissions(folder, fs::perms::none);
  expect_not_whole(store, "cannot look into the folder '" + folder.string());
  fs::permissions(folder, fs::perms::owner_all);
}

TEST_F(VerifyCommand, AGroupThatIsGoneIsDamage) {
  for (const Arguments& how : {Arguments{}, Arguments{"--ome", "0.4"}}) {
    const std::string store = make_store(how.empty() ? "a" : "b", how);
    ASSERT_EQ(run({"verify", store}).exit_code, 0);
    for (const std::string file : {"/isobrick/zarr.json", "/isobrick/0/zarr.json", "/.zgroup"}) {
      const fs::path group = store + file;
      if (!fs::exists(group)) continue;
      const std::string text = read_file(group);
      fs::remove(group);
      expect_not_whole(store, group.string() + "' is missing");
      write_file(group, "{}");
      expect_not_whole(store, group.string());
      write_file(group, text);
      if (geteuid() != 0) {
        fs::permissions(group, fs::perms::none);
        expect_not_whole(store, group.string());
        fs::permissions(group, fs::perms::owner_read | fs::perms::owner_write);
      }
    }
    EXPECT_EQ(run({"verify", store}).exit_code, 0);
  }
}

// Four bricks of 16 MiB at a time would take twice as much.
TEST_F(VerifyCommand, StaysWithinItsBudget) {
  const std::string store = path("a.zarr");
  ASSERT_EQ(run({"synth", "gyroid", store, "--dims", "512,512,256", "--type", "u8", "--brick",
                 "256", "--levels", "1", "--build-index", "octree"})
                .exit_code,
            0);
  const json roomy = run_json({"verify", store, "--threads", "4"});
  EXPECT_GT(roomy["peak_resident_bytes"].get<std::uint64_t>(), 150 * kMiB);
  const json tight = run_json({"verify", store, "--threads", "4", "--memory", "120M"});
  EXPECT_TRUE(tight["whole"]);
  EXPECT_LE(tight["peak_resident_bytes"].get<std::uint64_t>(), 120 * kMiB);
  expect_refused(run({"verify", store, "--memory", "60M"}), 2,
                 {"memory budget of 60 MiB is too small", "--memory ", "at least"});
}

TEST_F(VerifyCommand, AHugeChunkIsNotTakenIntoMemory) {
  const std::string array = write_array("huge", 1290, 1290);
  expect_refused(run({"verify", array, "--memory", "1G"}), 2, {"1290 × 1290 × 1290", "at least"});
  const json info = run_json({"info", array, "--stats", "--memory", "1G"});
  EXPECT_EQ(info["histogram"], nullptr);
  EXPECT_LE(info["peak_resident_bytes"].get<std::uint64_t>(), 64 * kMiB);
  EXPECT_NE(run({"info", array, "--stats"}).out.find("histogram    none: a chunk of level 0 takes"),
            std::string::npos);
}

TEST_F(VerifyCommand, TooManyChunksAreNotLookedFor) {
  const std::string array = write_array("tiny", 1000, 1);
  expect_not_whole(array, "of its 1000000000 chunk files at most");
  expect_not_whole(write_array("many", 2064, 16), "of its 2146689 chunk files at most 2097152");
  const json info = run_json({"info", array, "--stats"});
  EXPECT_EQ(info["histogram"], nullptr);
  EXPECT_EQ(info["levels"][0]["bricks_stored"], nullptr);
  EXPECT_LE(info["peak_resident_bytes"].get<std::uint64_t>(), 64 * kMiB);
  EXPECT_NE(run({"info", array, "--stats"}).out.find("too many to look for"), std::string::npos);
  // Without samples there is nothing to look for.
  EXPECT_NE(run({"info", array}).out.find("histogram    with --stats"), std::string::npos);
}

}  // namespace
}  // namespace isobrick::test

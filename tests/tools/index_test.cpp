#include <map>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class IndexCommand : public ProgramTest {
 protected:
  std::string mesh(const std::string& store, const std::string& index) {
    EXPECT_EQ(run({"extract", store, "--isovalue", "127.5", "--search", index, "-o", path("m.ply"),
                   "--force"})
                  .exit_code,
              0);
    return read_file(path("m.ply"));
  }

  static std::map<std::string, std::string> tree(const std::string& store) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(store))
      if (entry.is_regular_file())
        files[fs::relative(entry.path(), store).string()] = read_file(entry.path());
    return files;
  }
};

TEST_F(IndexCommand, AddsKindsThatExtractUsesAndInfoShows) {
  const std::string store = make_store("a");
  const std::string expected = mesh(store, "linear");
  EXPECT_TRUE(mesh(store, "auto") == expected);
  for (const std::string kind : {"interval", "kdtree", "quadtree", "octree"}) {
    const nlohmann::json made = run_json({"index", store, "--kind", kind, "--leaf", "4"});
    EXPECT_EQ(made["command"], "index");
    EXPECT_EQ(made["kind"], kind);
    EXPECT_EQ(made["leaf"], 4);
    EXPECT_GT(made["bytes"].get<int>(), 0);
    EXPECT_EQ(made["level_bytes"].size(), 3u);
    EXPECT_EQ(made["ranges_added"], false);
    EXPECT_TRUE(mesh(store, kind) == expected);
    const nlohmann::json used = run_json({"extract", store, "--isovalue", "127.5", "--search", kind,
                                          "-o", path("n.ply"), "--force"})["surfaces"][0];
    EXPECT_EQ(used["index"]["used"], kind);
    EXPECT_GT(used["index"]["bytes_read"].get<int>(), 0);
    EXPECT_GT(used["index"]["seconds"].get<double>(), 0);
  }
  EXPECT_TRUE(mesh(store, "auto") == expected);
  ASSERT_EQ(run({"index", store, "--kind", "kdtree", "--force"}).exit_code, 0);
  EXPECT_TRUE(mesh(store, "auto") == expected);
  const nlohmann::json automatic = run_json(
      {"extract", store, "--isovalue", "127.5", "-o", path("n.ply"), "--force"})["surfaces"][0];
  EXPECT_EQ(automatic["index"]["used"], "kdtree") << "the only one with leaf 16";
  ASSERT_EQ(run({"index", store, "--kind", "kdtree", "--leaf", "4", "--force"}).exit_code, 0);
  const nlohmann::json info = run_json({"info", store, "--stats"});
  EXPECT_EQ(info["index_kinds"], nlohmann::json({"interval", "kdtree", "octree", "quadtree"}));
  ASSERT_EQ(info["indexes"].size(), 4u);
  EXPECT_EQ(info["indexes"][2]["kind"], "octree");
  EXPECT_EQ(info["indexes"][2]["leaf"], 4);
  ASSERT_EQ(info["indexes"][2]["levels"].size(), 3u);
  std::uint64_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(store))
    if (entry.is_regular_file() && entry.path().string().find("/octree/") != std::string::npos)
      bytes += entry.file_size();
  EXPECT_EQ(info["indexes"][2]["bytes"], bytes);
  EXPECT_NE(run({"info", store}).out.find("octree, leaf 4"), std::string::npos);
  const nlohmann::json verified = run_json({"verify", store});
  EXPECT_EQ(verified["indexes"].size(), 12u);
}

TEST_F(IndexCommand, ConvertAddsOneAtOnce) {
  const std::string later = make_store("a"), at_once = make_store("b", {"--build-index", "octree"});
  const nlohmann::json made = run_json({"index", later, "--kind", "octree"});
  EXPECT_EQ(made["leaf"], 16);
  EXPECT_TRUE(tree(later) == tree(at_once));
  write_file(path("in.raw"), noise(20 * 20 * 20));
  const nlohmann::json json =
      run_json({"convert", path("in.raw"), path("c.zarr"), "--dims", "20,20,20", "--type", "u8",
                "--build-index", "kdtree", "--leaf", "2"});
  EXPECT_GT(json["index_bytes"].get<int>(), 0);
  EXPECT_GT(json["index_seconds"].get<double>(), 0);
  EXPECT_EQ(run_json({"info", path("c.zarr")})["index_kinds"], nlohmann::json({"kdtree"}));
}

TEST_F(IndexCommand, WhatMakesNoSenseIsRefused) {
  const std::string store = make_store("a");
  expect_refused(run({"index", store, "--kind", "linear"}), 2, {"--kind", "interval"});
  expect_refused(run({"index", store, "--kind", "octree", "--leaf", "3"}), 2, {"--leaf", "16"});
  expect_refused(run({"index", path("none.zarr"), "--kind", "octree"}), 1, {"none.zarr"});
  expect_refused(run({"index", store, "--kind", "octree", "--memory", "1M"}), 2, {"--memory"});
  expect_refused(
      run({"extract", store, "--isovalue", "9", "--search", "octree", "-o", path("a.ply")}), 2,
      {"run: isobrick index " + store + " --kind octree\n"});
  expect_refused(
      run({"extract", store, "--isovalue", "9", "--search", "tree", "-o", path("a.ply")}), 2,
      {"--search", "kdtree"});
  expect_refused(run({"synth", "gyroid", path("a.raw"), "--dims", "9,9,9", "--type", "u8",
                      "--build-index", "octree"}),
                 2, {"--build-index"});
  EXPECT_EQ(run({"index", store, "--kind", "octree"}).exit_code, 0);
  expect_refused(run({"index", store, "--kind", "octree"}), 2, {"--force"});
  EXPECT_EQ(run({"index", store, "--kind", "octree", "--leaf", "8", "--force"}).exit_code, 0);
}

TEST_F(IndexCommand, AFullDiskLeavesTheStoreAndAResumeGoesOn) {
  const std::string store = make_store("a"), whole = make_store("b");
  const auto before = tree(store);
  const Arguments index{"index", store, "--kind", "interval", "--leaf", "1"};
  const Outcome full = run(index, {.file_blocks = 8});
  expect_refused(full, 1, {"cannot write"});
  auto left = tree(store);
  std::erase_if(left, [](const auto& file) {
    return file.first.find("interval.partial/") != std::string::npos;
  });
  EXPECT_TRUE(left == before);
  EXPECT_EQ(run_json({"info", store})["index_kinds"], nlohmann::json::array());
  expect_refused(run(index), 2, {"--resume", "--force"});
  Arguments resume = index;
  resume.push_back("--resume");
  EXPECT_EQ(run(resume).exit_code, 0);
  ASSERT_EQ(run({"index", whole, "--kind", "interval", "--leaf", "1"}).exit_code, 0);
  EXPECT_TRUE(tree(store) == tree(whole));
}

TEST_F(IndexCommand, VerifyNamesDamagedFilesOfAnIndex) {
  const std::string store = make_store("a", {"--build-index", "quadtree", "--leaf", "4"});
  for (const auto& entry : fs::recursive_directory_iterator(store)) {
    const std::string file = entry.path().string();
    if (!entry.is_regular_file() || file.find("/index/") == std::string::npos) continue;
    const std::string bytes = read_file(file);
    std::string damaged = bytes;
    damaged[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
    write_file(file, damaged);
    const Outcome outcome = run({"verify", store});
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_NE(outcome.out.find(file), std::string::npos) << outcome.out;
    EXPECT_NE(outcome.out.find("quadtree"), std::string::npos) << outcome.out;
    write_file(file, bytes);
  }
}

TEST_F(IndexCommand, AnInterruptLeavesWhatAResumeTakes) {
  const std::string store = path("a.zarr");
  ASSERT_EQ(run({"synth", "gyroid", store, "--dims", "300,300,300", "--type", "u8"}).exit_code, 0);
  const Outcome outcome = run({"index", store, "--kind", "kdtree", "--leaf", "1", "--threads", "1"},
                              {.interrupt_after = 0.3});
  if (outcome.exit_code == 0) GTEST_SKIP() << "it was faster than the interrupt";
  EXPECT_EQ(run_json({"info", store})["index_kinds"], nlohmann::json::array());
  EXPECT_EQ(run({"index", store, "--kind", "kdtree", "--leaf", "1", "--resume"}).exit_code, 0);
  EXPECT_TRUE(mesh(store, "kdtree") == mesh(store, "linear"));
}

}  // namespace
}  // namespace isobrick::test

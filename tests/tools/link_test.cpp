#include <map>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// Symbolic links in a store, as a hostile archive has them: nothing is written through them.
class Link : public ProgramTest {
 protected:
  Link() {
    fs::create_directory(path("home"));
    write_file(path("home/thesis.txt"), "precious");
    write_file(path("a.raw"), noise(20 * 20 * 20));
  }

  /// An image of another program.
  std::string make_foreign(const std::string& name) {
    const std::string image = make_store(name);
    nlohmann::json root = nlohmann::json::parse(read_file(image + "/zarr.json"));
    root["attributes"].erase("isobrick");
    write_file(image + "/zarr.json", root.dump());
    fs::remove_all(image + "/isobrick");
    return image;
  }

  void expect_untouched() const {
    std::map<std::string, std::string> home;
    for (const auto& entry : fs::recursive_directory_iterator(path("home")))
      home[entry.path().filename().string()] =
          entry.is_regular_file() ? read_file(entry.path()) : "";
    EXPECT_EQ(home, (std::map<std::string, std::string>{{"thesis.txt", "precious"}}));
    EXPECT_FALSE(fs::exists(path("made")));
  }

  void link_file(const std::string& name, bool dangling = false) const {
    fs::create_directories(fs::path(name).parent_path());
    fs::remove(name);
    fs::create_symlink(dangling ? path("made") : path("home/thesis.txt"), name);
  }
  void link_folder(const std::string& name) const {
    fs::create_directories(fs::path(name).parent_path());
    fs::create_directory_symlink(path("home"), name);
  }

  Arguments convert(const Arguments& more = {}) const {
    Arguments all{"convert", path("a.raw"), path("a.zarr"), "--dims", "20,20,20",
                  "--type",  "u8",          "--brick",      "16"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
};

TEST_F(Link, AnIndexReplacesLinksWithTheNamesOfItsFiles) {
  for (const bool dangling : {false, true})
    for (const char* file : {"/isobrick/ranges.json.tmp", "/isobrick/ranges.json",
                             "/isobrick/0/range.partial/zarr.json.tmp",
                             "/isobrick/0/index/octree.partial/index.json.tmp"}) {
      const std::string image = make_foreign("f");
      link_file(image + file, dangling);
      const Outcome outcome = run({"index", image, "--kind", "octree", "--force"});
      // Either it is replaced by a file or the folder is refused.
      EXPECT_TRUE(outcome.exit_code == 0 || outcome.exit_code == 2 || outcome.exit_code == 1);
      if (outcome.exit_code == 0) {
        EXPECT_FALSE(fs::is_symlink(image + "/isobrick/ranges.json"));
        EXPECT_EQ(run({"verify", image}).exit_code, 0);
      } else {
        EXPECT_NE(outcome.err.find(image), std::string::npos) << outcome.err;
      }
      expect_untouched();
      fs::remove_all(image);
    }
}

TEST_F(Link, AFolderOfAStoreIsNoLink) {
  for (const char* folder :
       {"/isobrick", "/isobrick/0", "/isobrick/0/index", "/isobrick/0/index/octree",
        "/isobrick/0/index/octree.partial", "/isobrick/0/range.partial", "/isobrick/0/block_range"})
    for (const char* flag : {"--resume", "--force"}) {
      const std::string image = make_foreign("f");
      link_folder(image + folder);
      const Outcome outcome = run({"index", image, "--kind", "octree", flag});
      EXPECT_TRUE(outcome.exit_code == 1 || outcome.exit_code == 2) << folder << outcome.err;
      EXPECT_NE(outcome.err.find(folder), std::string::npos) << outcome.err;
      expect_untouched();
      fs::remove_all(image);
    }
}

TEST_F(Link, AResumedConversionReplacesLinksToFiles) {
  ASSERT_EQ(run(convert()).exit_code, 0);
  const std::string whole = path("a.zarr"), partial = path("a.zarr.partial");
  const std::string shard = read_file(whole + "/0/c/0/0/0");
  // The marker of the interrupted conversion, from one that stops.
  ASSERT_NE(run(convert({"--force"}), {.file_blocks = 8}).exit_code, 0);
  const std::string marker = read_file(partial + "/.isobrick-layout.json");
  for (const bool dangling : {false, true})
    for (const char* file : {"/convert.journal", "/convert.journal.tmp", "/0/c/0/0/0.tmp",
                             "/0/zarr.json.tmp", "/isobrick/zarr.json.tmp", "/zarr.json.tmp",
                             "/0/zarr.json", "/isobrick/0/range/c/0/0/0/0"}) {
      fs::remove_all(whole);
      fs::remove_all(partial);
      fs::create_directory(partial);
      write_file(partial + "/.isobrick-layout.json", marker);
      link_file(partial + file, dangling);
      const Outcome outcome = run(convert({"--resume"}));
      if (outcome.exit_code == 0) {
        EXPECT_EQ(read_file(whole + "/0/c/0/0/0"), shard);
        for (const auto& entry : fs::recursive_directory_iterator(whole))
          EXPECT_FALSE(entry.is_symlink()) << entry.path();
      } else {
        expect_refused(outcome, 1, {"journal", "is a symbolic link"});
      }
      expect_untouched();
    }
  for (const char* folder : {"/0", "/0/c", "/isobrick", "/isobrick/0/range"}) {
    fs::remove_all(whole);
    fs::remove_all(partial);
    fs::create_directory(partial);
    write_file(partial + "/.isobrick-layout.json", marker);
    link_folder(partial + folder);
    expect_refused(run(convert({"--resume"})), 1, {folder, "is a symbolic link"});
    expect_untouched();
  }
}

}  // namespace
}  // namespace isobrick::test

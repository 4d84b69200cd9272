#include <sys/stat.h>

#include <map>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// What --force must not take away.
class Force : public ProgramTest {
 protected:
  Force() { write_file(path("a.raw"), noise(20 * 20 * 20)); }

  Arguments convert(const std::string& input, const std::string& output) const {
    return {"convert", input, output,    "--dims", "20,20,20",
            "--type",  "u8",  "--brick", "16",     "--force"};
  }

  using Tree = std::map<std::string, std::string>;
  static Tree tree(const fs::path& folder) {
    Tree files;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      files[fs::relative(entry.path(), folder).string()] =
          entry.is_regular_file() ? read_file(entry.path()) : "";
    return files;
  }

  /// Refuses, and leaves everything in the test's folder as it was.
  void expect_kept(const Arguments& arguments, std::initializer_list<std::string> parts) const {
    const Tree before = tree(path("."));
    expect_refused(run(arguments), 2, parts);
    EXPECT_TRUE(tree(path(".")) == before) << arguments[0];
  }
};

TEST_F(Force, ReplacesAStoreOfOursAndNothingElse) {
  make_store("a", {"--build-index", "octree"});
  EXPECT_EQ(run(convert(path("a.raw"), path("a.zarr"))).exit_code, 0);
  fs::create_directory(path("empty"));
  EXPECT_EQ(run(convert(path("a.raw"), path("empty"))).exit_code, 0);
  for (const char* foreign : {"photo.jpg", "0/notes.txt", "isobrick/0/range/c/0/0/mine",
                              "isobrick/0/index/octree/c/0/0/0/deeper", "labels/zarr.json"}) {
    make_store("b", {"--build-index", "octree"});
    fs::remove_all(path("b.zarr/isobrick/0/index/octree/c/0/0/0"));
    fs::create_directories(fs::path(path(std::string("b.zarr/") + foreign)).parent_path());
    write_file(path(std::string("b.zarr/") + foreign), "mine");
    const std::string first = std::string(foreign).substr(0, std::string(foreign).rfind('/'));
    expect_kept(convert(path("a.raw"), path("b.zarr")), {"b.zarr", first, "no part of a store"});
    fs::remove_all(path("b.zarr"));
  }
  for (const bool dangling : {false, true}) {
    make_store("b");
    fs::create_symlink(dangling ? "nothing" : path("a.raw"), path("b.zarr/0/c/9"));
    expect_kept(convert(path("a.raw"), path("b.zarr")), {"0/c/9", "no part of a store"});
    fs::remove_all(path("b.zarr"));
  }
}

TEST_F(Force, KeepsFoldersOfOtherPrograms) {
  fs::create_directory(path("photos"));
  write_file(path("photos/zarr.json"), "{}");
  write_file(path("photos/summer.jpg"), "mine");
  expect_kept(convert(path("a.raw"), path("photos")), {"photos", "summer.jpg"});
  // A group of another program: every name in it could be ours.
  fs::create_directories(path("group/0/c/0/0"));
  write_file(path("group/0/c/0/0/0"), "samples");
  write_file(path("group/0/zarr.json"), R"({"zarr_format":3,"node_type":"array"})");
  expect_kept(convert(path("a.raw"), path("group")), {"group", "it has no zarr.json"});
  write_file(path("group/zarr.json"), R"({"zarr_format":3,"node_type":"group","attributes":{}})");
  expect_kept(convert(path("a.raw"), path("group")), {"group", "another program's"});
  write_file(path("group/zarr.json"), "not JSON");
  expect_kept(convert(path("a.raw"), path("group")), {"group", "zarr.json"});
  write_file(path("group/1"), "a file");
  expect_kept(convert(path("a.raw"), path("group")), {"'1'"});
  expect_kept({"synth", "gyroid", path("photos"), "--dims", "20,20,20", "--type", "u8", "--force"},
              {"summer.jpg"});
  // Neither what lies in the way of the unfinished store.
  fs::rename(path("photos"), path("c.zarr.partial"));
  write_file(path("c.zarr.partial/.isobrick-layout.json"), "{}");
  expect_kept(convert(path("a.raw"), path("c.zarr")), {"c.zarr.partial", "summer.jpg"});
}

TEST_F(Force, KeepsTheInputOfAConversion) {
  const std::string store = make_store("a");
  expect_kept({"convert", store, store, "--force", "--part", "1/2"}, {"a.zarr", "it is the input"});
  EXPECT_FALSE(fs::exists(store + ".parts"));
  expect_kept({"convert", store, store, "--force"}, {"a.zarr", "it is the input"});
  expect_kept({"convert", store + "/0", store, "--force"}, {"a.zarr", "lies in it"});
  fs::create_symlink(store, path("link"));
  expect_kept({"convert", path("link/0"), store, "--force"}, {"a.zarr", "lies in it"});
  expect_kept({"convert", path("link"), store, "--force"}, {"a.zarr", "it is the input"});
  const std::string shard = store + "/0/c/0/0/0";
  expect_kept(
      {"convert", shard, store, "--dims", "1,1,9", "--type", "u8", "--offset", "1", "--force"},
      {"a.zarr"});
}

/// Samples that a header elsewhere names.
TEST_F(Force, KeepsTheFilesThatAHeaderNames) {
  make_store("a");
  const std::string shard = "a.zarr/0/c/0/0/0";
  write_file(path("in.nhdr"),
             "NRRD0005\ntype: uint8\ndimension: 3\nsizes: 10 10 10\nencoding: raw\n"
             "byte skip: -1\ndata file: " +
                 shard + "\n");
  write_file(path("in.mhd"),
             "ObjectType = Image\nNDims = 3\nDimSize = 10 10 10\nElementType = MET_UCHAR\n"
             "HeaderSize = -1\nElementDataFile = " +
                 shard + "\n");
  for (const char* header : {"in.nhdr", "in.mhd"})
    expect_kept({"convert", path(header), path("a.zarr"), "--force"}, {"a.zarr", "lies in it"});
}

/// Names as a store has them, which this one has not.
TEST_F(Force, KeepsWhatTheStoreDoesNotHave) {
  for (const char* name :
       {"spool", "spool.partial-thesis.txt", "0/5.tmp", "7/c/1/1/1", "2024/c/1/1/1", "0/c/9/9/9"}) {
    make_store("b");
    fs::create_directories(fs::path(path(std::string("b.zarr/") + name)).parent_path());
    write_file(path(std::string("b.zarr/") + name), "mine");
    expect_kept(convert(path("a.raw"), path("b.zarr")), {"b.zarr", "no part of a store"});
    fs::remove_all(path("b.zarr"));
  }
}

TEST_F(Force, KeepsTheCurrentDirectory) {
  const std::string store = make_store("a", {"--build-index", "octree"});
  for (const char* folder : {".", "0/c", "isobrick/0/index/octree"}) {
    const std::string here = store + "/" + folder;
    const auto in_it = [&](const Arguments& arguments) {
      Arguments words{"env", "-C", here, ISOBRICK_PROGRAM};
      words.insert(words.end(), arguments.begin(), arguments.end());
      return run_process(words);
    };
    const auto before = tree(store);
    expect_refused(in_it(convert(path("a.raw"), store)), 2, {"current directory"});
    const Outcome index = in_it({"index", store, "--kind", "octree", "--force"});
    if (std::string(folder).starts_with("isobrick"))
      expect_refused(index, 2, {"octree", "current directory"});
    else
      EXPECT_EQ(index.exit_code, 0) << index.err;
    EXPECT_TRUE(tree(store) == before);
  }
}

TEST_F(Force, AnIndexReplacesNothingElse) {
  const std::string store = make_store("a", {"--build-index", "octree"});
  write_file(store + "/isobrick/0/index/octree/notes.txt", "mine");
  expect_kept({"index", store, "--kind", "octree", "--force"}, {"notes.txt"});
  fs::rename(store + "/isobrick/0/index/octree", store + "/isobrick/0/index/octree.partial");
  expect_kept({"index", store, "--kind", "octree", "--force"}, {"notes.txt"});
}

TEST_F(Force, KeepsTheStoreThatIsRead) {
  const std::string store = make_store("a");
  const std::string shard = "/0/c/0/0/0";
  expect_kept({"export", store, store + shard, "--force"}, {shard, "part of the input"});
  expect_kept(
      {"extract", store, "--isovalue", "127", "-o", store + shard, "--format", "ply", "--force"},
      {shard, "part of the input"});
  for (const std::string file : {"/zarr.json", "/0/zarr.json", "/0/c/0/0/0"}) {
    fs::create_symlink(store + file, path("link"));
    expect_kept({"export", store, path("link"), "--force"}, {"link", "part of the input"});
    fs::remove(path("link"));
    fs::create_hard_link(store + file, path("same"));
    EXPECT_EQ(run({"export", store, path("same"), "--force"}).exit_code, 0);
    EXPECT_EQ(run({"verify", store}).exit_code, 0);
    fs::remove(path("same"));
  }
}

TEST_F(Force, KeepsTheMeshThatIsDrawn) {
  if (run({"render", "--help"}).out.find("without") != std::string::npos) GTEST_SKIP();
  const std::string store = make_store("a");
  ASSERT_EQ(run({"extract", store, "--isovalue", "127", "-o", path("m.ply")}).exit_code, 0);
  fs::create_symlink("m.ply", path("link.png"));
  fs::create_hard_link(path("m.ply"), path("same.png"));
  for (const char* picture : {"m.ply", "link.png", "same.png"})
    expect_kept({"render", path("m.ply"), "-o", path(picture), "--force"}, {picture});
}

TEST_F(Force, KeepsWhatIsNoRegularFile) {
  const std::string store = make_store("a");
  fs::create_symlink("/dev/null", path("null"));
  fs::create_symlink("nothing", path("dangling"));
  fs::create_symlink(".", path("folder"));
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  fs::create_symlink("pipe", path("piped"));
  for (const std::string name : {"null", "dangling", "folder", "pipe", "piped"}) {
    for (const Arguments& command :
         {Arguments{"export", store, path(name), "--force"},
          Arguments{"extract", store, "--isovalue", "127", "--format", "stl", "--force", "-o",
                    path(name)},
          Arguments{"extract", store, "--isovalue", "127", "--format", "pvtp", "--force", "-o",
                    path(name)},
          Arguments{"extract", store, "--isovalue", "127", "--format", "neuroglancer", "--force",
                    "-o", path(name)},
          Arguments{"extract", store, "--isovalue", "127", "--format", "3dtiles", "--force", "-o",
                    path(name)},
          Arguments{"extract", store, "--isovalue", "127", "--force", "--preview", path(name)},
          Arguments{"render", path("a.raw"), "--force", "-o", path(name)}}) {
      const Outcome outcome = run(command);
      expect_refused(outcome, 2, {command[0] == "render" ? "" : name});
    }
    fs::create_symlink(name, path("s.raw"));
    expect_refused(
        run({"synth", "gyroid", path("s.raw"), "--dims", "8,8,8", "--type", "u8", "--force"}), 2,
        {"s.raw"});
    fs::remove(path("s.raw"));
    EXPECT_TRUE(fs::exists(fs::symlink_status(path(name)))) << name;
    EXPECT_FALSE(fs::is_regular_file(fs::symlink_status(path(name)))) << name;
  }
}

}  // namespace
}  // namespace isobrick::test

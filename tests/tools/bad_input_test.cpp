#include <utility>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

using BadInput = ProgramTest;

Arguments operator+(Arguments left, const Arguments& right) {
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

TEST_F(BadInput, CommandLinesThatMakeNoSense) {
  const Arguments convert{"convert", path("in.raw"), path("out.zarr")};
  const std::vector<std::pair<Arguments, std::string>> lines{
      {{"paint"}, "unknown subcommand 'paint'"},
      {{"convert"}, "IN"},
      {{"info"}, "INPUT"},
      {{"extract", path("a.zarr"), "--isovalue", "abc", "-o", path("a.ply")}, "abc"},
      {{"extract", path("a.zarr"), "--isovalue", "nan", "-o", path("a.ply")}, "nan"},
      {{"extract", path("a.zarr"), "--isovalue", "1", "--isovalue", "1", "-o", path("a.ply")},
       "twice"},
      {{"extract", path("a.zarr"), "--isovalue", "1", "-o", path("a.doc")}, "a.doc"},
      {{"completion", "tcsh"}, "tcsh"},
      {{"synth", "cube", path("a.raw"), "--dims", "2,2,2", "--type", "u8"}, "cube"},
      {{"synth", "sphere", path("a.raw"), "--type", "u8"}, "--dims"},
      {convert + Arguments{"--colour", "red"}, "--colour"},
      {convert + Arguments{"--dims", "2,2"}, "--dims"},
      {convert + Arguments{"--dims", "0,2,2"}, "0"},
      {convert + Arguments{"--dims", "-2,2,2"}, "-2"},
      {convert + Arguments{"--dims", "4294967296,4294967296,2"}, "too large"},
      {convert + Arguments{"--dims", "99999999999999999999,1,1"}, "99999999999999999999"},
      {convert + Arguments{"--type", "u128"}, "u128"},
      {convert + Arguments{"--endian", "middle"}, "middle"},
      {convert + Arguments{"--codec", "rar"}, "rar"},
      {convert + Arguments{"--brick", "8"}, "--brick"},
      {convert + Arguments{"--memory", "lots"}, "lots"},
      {convert + Arguments{"--threads", "0"}, "--threads"},
  };
  for (const auto& [arguments, part] : lines) {
    SCOPED_TRACE(part);
    expect_refused(run(arguments), 2, {part});
  }
  EXPECT_TRUE(files().empty());
}

TEST_F(BadInput, AShardSmallerThanABrick) {
  write_file(path("in.raw"), noise(64 * 64 * 64));
  expect_refused(run({"convert", path("in.raw"), path("out.zarr"), "--dims", "64,64,64", "--type",
                      "u8", "--brick", "64", "--shard", "32"}),
                 2, {"32", "64"});
  EXPECT_EQ(files(), Arguments{"in.raw"});
}

TEST_F(BadInput, WrongSizeNamesBothNumbers) {
  for (const std::size_t size : {1999u, 2001u, 0u}) {
    write_file(path("in.raw"), noise(size));
    expect_refused(
        run({"convert", path("in.raw"), path("out.zarr"), "--dims", "10,10,10", "--type", "i16"}),
        2, {"2000", std::to_string(size)});
    EXPECT_EQ(files(), Arguments{"in.raw"});
  }
}

TEST_F(BadInput, UnknownExtentOrType) {
  write_file(path("in.raw"), noise(1000));
  expect_refused(run({"convert", path("in.raw"), path("out.zarr")}), 2, {"in.raw"});
  expect_refused(run({"convert", path("in.raw"), path("out.zarr"), "--dims", "10,10,10"}), 2, {});
  EXPECT_EQ(files(), Arguments{"in.raw"});
}

TEST_F(BadInput, ShortStandardInput) {
  write_file(path("in"), noise(999));
  const Outcome outcome =
      run({"convert", "-", path("out.zarr"), "--dims", "10,10,10", "--type", "u8"},
          {.input = path("in")});
  expect_refused(outcome, 2, {"standard input", "1000", "999"});
  EXPECT_FALSE(std::filesystem::exists(path("out.zarr")));
}

TEST_F(BadInput, MissingAndUnreadableInput) {
  expect_refused(
      run({"convert", path("none.raw"), path("out.zarr"), "--dims", "1,1,1", "--type", "u8"}), 1,
      {"none.raw"});
  expect_refused(run({"info", path("none.zarr")}), 1, {"none.zarr"});
  expect_refused(run({"verify", path("none.zarr")}), 1, {"none.zarr"});
  expect_refused(run({"extract", path("none.zarr"), "--isovalue", "1", "-o", path("a.ply")}), 1,
                 {"none.zarr"});
  expect_refused(run({"export", path("none.zarr"), path("a.raw")}), 1, {"none.zarr"});
  EXPECT_TRUE(files().empty());
}

TEST_F(BadInput, AFileIsNoStore) {
  write_file(path("a.zarr"), "not a store");
  expect_refused(run({"info", path("a.zarr")}), 1, {"a.zarr"});
}

TEST_F(BadInput, ExistingOutputsStayAsTheyAre) {
  const std::string store = make_store("a");
  write_file(path("in.raw"), noise(1000));
  write_file(path("mesh.ply"), "mine");
  write_file(path("picture.png"), "mine");
  write_file(path("out.raw"), "mine");
  const std::string before = read_file(store + "/zarr.json");
  const std::vector<std::string> names = files();
  expect_refused(run({"convert", path("in.raw"), store, "--dims", "10,10,10", "--type", "u8"}), 2,
                 {"a.zarr", "--force"});
  expect_refused(run({"synth", "sphere", store, "--dims", "9,9,9", "--type", "u8"}), 2,
                 {"a.zarr", "--force"});
  expect_refused(run({"extract", store, "--isovalue", "127.5", "-o", path("mesh.ply")}), 2,
                 {"mesh.ply", "--force"});
  expect_refused(run({"extract", store, "--isovalue", "127.5", "-o", path("new.ply"), "--preview",
                      path("picture.png")}),
                 2, {"picture.png", "--force"});
  expect_refused(run({"export", store, path("out.raw")}), 2, {"out.raw", "--force"});
  expect_refused(run({"synth", "sphere", path("out.raw"), "--dims", "9,9,9", "--type", "u8"}), 2,
                 {"out.raw", "--force"});
  EXPECT_EQ(files(), names);
  EXPECT_EQ(read_file(store + "/zarr.json"), before);
  for (const char* name : {"mesh.ply", "picture.png", "out.raw"})
    EXPECT_EQ(read_file(path(name)), "mine");
}

TEST_F(BadInput, ForceReplaces) {
  const std::string store = make_store("a");
  EXPECT_EQ(
      run({"synth", "sphere", store, "--dims", "20,20,20", "--type", "u8", "--force"}).exit_code,
      0);
  EXPECT_EQ(run_json({"info", store})["extent"], nlohmann::json({20, 20, 20}));
  write_file(path("mesh.ply"), "mine");
  EXPECT_EQ(
      run({"extract", store, "--isovalue", "127.5", "-o", path("mesh.ply"), "--force"}).exit_code,
      0);
  EXPECT_TRUE(read_file(path("mesh.ply")).starts_with("ply\n"));
  EXPECT_EQ(files(), (Arguments{"a.zarr", "mesh.ply"}));
}

// A path below a regular file can be written by nobody, not even by root.
TEST_F(BadInput, AFolderThatCannotBeWrittenTo) {
  const std::string store = make_store("a");
  write_file(path("file"), "");
  write_file(path("in.raw"), noise(1000));
  const std::string below = path("file") + "/out";
  expect_refused(
      run({"convert", path("in.raw"), below + ".zarr", "--dims", "10,10,10", "--type", "u8"}), 1,
      {"file"});
  expect_refused(run({"extract", store, "--isovalue", "127.5", "-o", below + ".ply"}), 1, {"file"});
  expect_refused(run({"extract", store, "--isovalue", "127.5", "--preview", below + ".png"}), 1,
                 {"file"});
  expect_refused(run({"export", store, below + ".raw"}), 1, {"file"});
  expect_refused(run({"synth", "sphere", below + ".raw", "--dims", "9,9,9", "--type", "u8"}), 1,
                 {"file"});
  EXPECT_EQ(files(), (Arguments{"a.zarr", "file", "in.raw"}));
}

TEST_F(BadInput, AFullDisk) {
  const std::string store = make_store("a");
  write_file(path("in_64x64x64_uint8.raw"), noise(64 * 64 * 64));
  const std::vector<std::string> names = files();
  const Surroundings full{.file_blocks = 8};
  expect_refused(run({"extract", store, "--isovalue", "127.5", "-o", path("a.ply")}, full), 1,
                 {"a.ply", "File too large"});
  expect_refused(run({"extract", store, "--isovalue", "127.5", "-o", path("a.stl")}, full), 1,
                 {"a.stl", "File too large"});
  for (const char* name : {"a.obj", "a.glb", "a.vtp", "a.pvtp"})
    expect_refused(run({"extract", store, "--isovalue", "127.5", "-o", path(name)}, full), 1,
                   {name, "File too large"});
  expect_refused(run({"export", store, path("a.raw")}, full), 1, {"a.raw", "File too large"});
  expect_refused(
      run({"synth", "sphere", path("b.raw"), "--dims", "64,64,64", "--type", "u8"}, full), 1,
      {"b.raw", "File too large"});
  EXPECT_EQ(files(), names);
  expect_refused(run({"convert", path("in_64x64x64_uint8.raw"), path("c.zarr")}, full), 1,
                 {"File too large"});
  EXPECT_FALSE(std::filesystem::exists(path("c.zarr")));
}

TEST_F(BadInput, AFolderThatIsNotThereIsNamed) {
  const std::string store = make_store("a");
  for (const char* more : {"--force", "--no-space-check"})
    expect_refused(
        run({"extract", store, "--isovalue", "127.5", "-o", path("no/such/x.ply"), more}), 1,
        {"cannot create", "no/such"});
  expect_refused(run({"extract", store, "--isovalue", "127.5", "-o", path("no/such/x.ply")}), 1,
                 {"there is no folder", "no/such"});
  expect_refused(run({"export", store, path("no/such/x.raw")}), 1, {"cannot create", "no/such"});
  write_file(path("in_2x2x2_uint8.raw"), "01234567");
  expect_refused(run({"convert", path("in_2x2x2_uint8.raw"), path("no/such/x.zarr")}), 1,
                 {"cannot open the folder", "no/such"});
}

TEST_F(BadInput, StandardInputOfAnotherLengthLeavesNothing) {
  for (const std::size_t bytes : {100'000u, 200'000u}) {
    write_file(path("in"), noise(bytes));
    const Outcome outcome =
        run({"convert", "-", path("q.zarr"), "--dims", "50,50,50", "--type", "u8"},
            {.input = path("in")});
    expect_refused(outcome, 2, {"standard input", "125000", "--dims 50,50,50", "--type u8"});
    EXPECT_EQ(files(), Arguments{"in"});
  }
}

TEST_F(BadInput, ASyntheticVolumeThatDoesNotFitTheDiskIsNotBegun) {
  expect_refused(
      run({"synth", "gyroid", path("x.raw"), "--dims", "90000,90000,90000", "--type", "f64"}), 1,
      {"x.raw' takes ", ", and its disk has", "free: choose another, or smaller --dims"});
  EXPECT_TRUE(files().empty());
}

// The standard library's own words for it are none of ours.
TEST_F(BadInput, APathThatCannotBeOneIsNamed) {
  const std::string store = make_store("a"), name = path(std::string(300, 'n'));
  for (const Arguments& arguments :
       {Arguments{"info", name}, Arguments{"verify", name}, Arguments{"export", name, path("b")},
        Arguments{"extract", name, "--isovalue", "1", "-o", path("b.ply")},
        Arguments{"extract", store, "--isovalue", "127.5", "-o", name + ".pvtp"},
        Arguments{"convert", name, path("b.zarr")},
        Arguments{"synth", "sphere", name + ".zarr", "--dims", "9,9,9", "--type", "u8"}}) {
    const Outcome outcome = run(arguments);
    expect_refused(outcome, 1, {"cannot ", "nnn", "File name too long"});
    EXPECT_EQ(outcome.err.find("filesystem"), std::string::npos) << outcome.err;
  }
  EXPECT_EQ(files(), Arguments{"a.zarr"});
}

TEST_F(BadInput, FormatsOfMeshes) {
  const std::string store = make_store("a");
  const std::vector<std::string> names = files();
  const Arguments extract{"extract", store, "--isovalue", "127.5"};
  expect_refused(run(extract + Arguments{"-o", path("a.step")}), 2,
                 {"a.step", ".pvtp", "--format"});
  expect_refused(run(extract + Arguments{"-o", path("a"), "--format", "step"}), 2,
                 {"--format", "'step'"});
  expect_refused(run(extract + Arguments{"-o", path("a.ply"), "--quantize"}), 2,
                 {"--quantize", "GLB", "PLY"});
  expect_refused(run(extract + Arguments{"-o", path("a.ply"), "--compress"}), 2,
                 {"--compress", "GLB", "PLY"});
  expect_refused(run(extract + Arguments{"-o", path("a\nb.pvtp")}), 2, {"XML"});
  // A budget that leaves no room for cutting the mesh in parts.
  const Arguments tight{"--memory", "40M", "--threads", "1"};
  EXPECT_EQ(run(extract + Arguments{"-o", path("b.ply")} + tight).exit_code, 0);
  expect_refused(run(extract + Arguments{"-o", path("a.pvtp")} + tight), 2, {"--memory"});
  EXPECT_EQ(files().size(), names.size() + 1);
  // Nobody's folder is taken for parts of a mesh.
  std::filesystem::create_directory(path("a.pvtp.parts"));
  write_file(path("a.pvtp.parts/thesis.tex"), "mine");
  expect_refused(run(extract + Arguments{"-o", path("a.pvtp"), "--force"}), 2, {"thesis.tex"});
  EXPECT_EQ(read_file(path("a.pvtp.parts/thesis.tex")), "mine");
}

TEST_F(BadInput, TwoOutputsOfOneName) {
  const std::string store = make_store("a");
  const std::vector<std::string> names = files();
  const Arguments extract{"extract", store, "--isovalue", "127.5", "--force"};
  expect_refused(run(extract + Arguments{"-o", path("x.ply"), "--preview", path("x.ply")}), 2,
                 {"two outputs", "x.ply"});
  expect_refused(run(extract + Arguments{"-o", path("x.ply"), "--preview", path("./x.ply")}), 2,
                 {"two outputs", "x.ply"});
  expect_refused(
      run(extract + Arguments{"--isovalue", "1", "-o", path("x.ply"), "--preview", path("x.ply")}),
      2, {"two outputs"});
  EXPECT_EQ(files(), names);
}

TEST_F(BadInput, APictureTooLargeForTheMemory) {
  const std::string store = make_store("a");
  expect_refused(run({"extract", store, "--isovalue", "127.5", "--preview", path("a.png"), "--size",
                      "16384x16384", "--memory", "1G"}),
                 2, {"16384 x 16384", "1024.0 MiB", "--size"});
  EXPECT_EQ(files(), Arguments{"a.zarr"});
}

TEST_F(BadInput, StandardErrorThatCannotBeWritten) {
  const std::string store = make_store("a"), raw = path("a.raw");
  const auto shell = [](const std::string& arguments) {
    return run_process({"/bin/sh", "-c", std::string(ISOBRICK_PROGRAM) + " " + arguments});
  };
  for (const std::string closed : {"2>/dev/full", "2>&-", "<&- 2>&-"}) {
    SCOPED_TRACE(closed);
    EXPECT_EQ(shell("info " + path("none.zarr") + " " + closed).exit_code, 1);
    EXPECT_EQ(shell("info " + closed).exit_code, 2);
    const std::string force = " --force -o " + path("a.ply") + " --isovalue ";
    // The remark that the surface is empty is lost, its file is whole.
    EXPECT_EQ(shell("extract " + store + force + "1000 " + closed).exit_code, 0);
    EXPECT_TRUE(read_file(path("a.ply")).starts_with("ply\n"));
    EXPECT_EQ(shell("export " + store + " " + raw + " --force " + closed).exit_code, 0);
    EXPECT_EQ(read_file(raw).size(), 40u * 36 * 33);
  }
  EXPECT_EQ(shell("info " + store + " >&-").exit_code, 1);
}

TEST_F(BadInput, AFullStandardOutput) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  expect_refused(run({"man"}, {.output = "/dev/full"}), 1, {"standard output"});
}

TEST_F(BadInput, ABudgetTooSmallNamesTheLeastThatDoes) {
  write_file(path("in_64x64x64_uint8.raw"), noise(64 * 64 * 64));
  expect_refused(run({"convert", path("in_64x64x64_uint8.raw"), path("c.zarr"), "--memory", "1K"}),
                 2, {});
  EXPECT_FALSE(std::filesystem::exists(path("c.zarr")));
  const std::string store = make_store("a");
  expect_refused(
      run({"extract", store, "--isovalue", "127.5", "-o", path("a.ply"), "--memory", "1K"}), 2, {});
  EXPECT_FALSE(std::filesystem::exists(path("a.ply")));
}

TEST_F(BadInput, LevelsAndRegionsThatAreNotThere) {
  const std::string store = make_store("a");
  expect_refused(run({"export", store, path("a.raw"), "--level", "9"}), 2, {"level 9"});
  expect_refused(run({"export", store, path("a.raw"), "--roi", "0:41,,"}), 2, {"0:41", "0:40"});
  expect_refused(run({"extract", store, "--isovalue", "1", "-o", path("a.ply"), "--roi", "5:5,,"}),
                 2, {"empty"});
  EXPECT_EQ(files(), Arguments{"a.zarr"});
}

TEST_F(BadInput, AStoreOfAnUnknownVersion) {
  const std::string store = make_store("a"), metadata = store + "/zarr.json";
  nlohmann::json json = nlohmann::json::parse(read_file(metadata));
  json["attributes"]["ome"]["version"] = "9.9";
  write_file(metadata, json.dump());
  for (const Arguments& arguments :
       {Arguments{"info", store}, Arguments{"verify", store}, Arguments{"export", store, path("b")},
        Arguments{"extract", store, "--isovalue", "127.5", "-o", path("a.ply")}})
    expect_refused(run(arguments), 1, {"9.9"});
  EXPECT_EQ(files(), Arguments{"a.zarr"});
}

}  // namespace
}  // namespace isobrick::test

#include <fcntl.h>

#include <filesystem>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class OutputName : public ProgramTest {
 protected:
  /// Standard output as it was written to a file.
  std::string streamed(const Arguments& arguments) {
    write_file(path("stream"), "");
    const Outcome outcome = run(arguments, {.output = path("stream")});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_NE(outcome.err.find('-'), std::string::npos) << outcome.err;
    std::string bytes = read_file(path("stream"));
    fs::remove(path("stream"));
    return bytes;
  }

  const std::string store_ = make_store("a");
};

TEST_F(OutputName, OfAVolumeSaysWhatIsWritten) {
  for (const char* name :
       {"x.tif", "x.nii", "x.nii.gz", "x.mha", "x.nhdr", "x.zarr", "x.dat", "x.ply"})
    expect_refused(run({"export", store_, path(name)}), 2,
                   {name, ".nrrd", ".vdb", ".raw", ".bin", "--format"});
  expect_refused(run({"export", store_, path("x.tif"), "--format", "raw"}), 2, {"x.tif", "raw"});
  expect_refused(run({"export", store_, path("x.vdb"), "--format", "nrrd"}), 2, {"x.vdb", "nrrd"});
  EXPECT_EQ(files(), (std::vector<std::string>{"a.zarr"}));
  for (const char* name : {"x.raw", "y.bin", "z", "W.RAW"})
    EXPECT_EQ(run({"export", store_, path(name)}).exit_code, 0) << name;
  EXPECT_EQ(run({"export", store_, path("v.dat"), "--format", "nrrd"}).exit_code, 0);
  EXPECT_EQ(files(), (std::vector<std::string>{"W.RAW", "W.nhdr", "a.zarr", "v.dat", "x.nhdr",
                                               "x.raw", "y.bin", "y.nhdr", "z", "z.nhdr"}));
}

TEST_F(OutputName, OfARawFileHasAHeaderBesideIt) {
  const std::string store = path("b.zarr");
  write_file(path("in"), noise(std::size_t{2} * 20 * 15 * 10));
  ASSERT_EQ(run({"convert", path("in"), store, "--dims", "20,15,10", "--type", "i16", "--spacing",
                 "0.5,0.25,3", "--origin", "1,2,-3", "--unit", "millimeter"})
                .exit_code,
            0);
  ASSERT_EQ(run({"export", store, path("x.raw")}).exit_code, 0);
  ASSERT_EQ(run({"convert", path("x.nhdr"), path("c.zarr")}).exit_code, 0);
  const nlohmann::json from = run_json({"info", store}), back = run_json({"info", path("c.zarr")});
  for (const char* key : {"extent", "type", "spacing", "origin", "unit", "direction"})
    EXPECT_EQ(from[key], back[key]) << key;
  ASSERT_EQ(run({"export", path("c.zarr"), path("y.raw")}).exit_code, 0);
  EXPECT_TRUE(read_file(path("x.raw")) == read_file(path("y.raw")));

  // The header counts as the output: it is not replaced, nor are the samples beside it.
  fs::remove(path("x.raw"));
  const std::string header = read_file(path("x.nhdr"));
  expect_refused(run({"export", store_, path("x.raw")}), 2, {"x.nhdr", "--force"});
  EXPECT_EQ(read_file(path("x.nhdr")), header);
  EXPECT_FALSE(fs::exists(path("x.raw")));
  ASSERT_EQ(run({"export", store_, path("x.raw"), "--force"}).exit_code, 0);
  EXPECT_NE(read_file(path("x.nhdr")), header);
}

TEST_F(OutputName, OfAPictureIsPng) {
  ASSERT_EQ(run({"extract", store_, "--isovalue", "128", "-o", path("m.ply")}).exit_code, 0);
  const Outcome render = run({"render", path("m.ply"), "-o", path("b.jpg")});
  if (render.err.find("built without") != std::string::npos) GTEST_SKIP() << render.err;
  expect_refused(render, 2, {"b.jpg", ".png"});
  expect_refused(run({"extract", store_, "--isovalue", "128", "--preview", path("b.jpg")}), 2,
                 {"b.jpg", ".png"});
  expect_refused(run({"view", store_, "--screenshot", path("b.tif")}), 2, {"b.tif", ".png"});
  EXPECT_EQ(files(), (std::vector<std::string>{"a.zarr", "m.ply"}));
}

TEST_F(OutputName, OfAStoreIsNoOtherFormats) {
  for (const char* name : {"b.nrrd", "b.tif", "b.nii.gz", "b.nrrd/"}) {
    expect_refused(run({"convert", store_, path(name)}), 2, {"b.", ".zarr"});
    expect_refused(run({"synth", "gyroid", path(name), "--dims", "8,8,8", "--type", "u8"}), 2,
                   {"b.", ".zarr"});
  }
  expect_refused(run({"convert", store_, "-"}), 2, {"standard output", ".zarr"});
  expect_refused(run({"synth", "gyroid", "-", "--dims", "8,8,8", "--type", "u8"}), 2, {"standard"});
  EXPECT_EQ(files(), (std::vector<std::string>{"a.zarr"}));
  EXPECT_EQ(run({"convert", store_, path("b")}).exit_code, 0);
}

TEST_F(OutputName, OfAMeshSaysWhatIsWritten) {
  const Arguments extract{"extract", store_, "--isovalue", "128", "-o"};
  const auto with = [&](const Arguments& more) {
    Arguments all = extract;
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  expect_refused(run(with({path("x.stl"), "--format", "ply"})), 2, {"x.stl", "ply"});
  expect_refused(run(with({path("x.png"), "--format", "ply"})), 2, {"x.png", "ply"});
  expect_refused(run(with({"-", "--format", "pvtp"})), 2, {"PVTP", "standard output"});
  for (const char* format : {"obj", "ply"})
    expect_refused(run(with({"-", "--format", format, "--isovalue", "9"})), 2, {"one"});
  expect_refused(run(with({"-", "--preview", "-"})), 2, {"standard output", "picture"});
  expect_refused(run({"extract", store_, "--isovalue", "9,128", "--preview", "-"}), 2, {"one"});
  EXPECT_EQ(files(), (std::vector<std::string>{"a.zarr"}));
  EXPECT_EQ(run(with({path("x.dat"), "--format", "ply"})).exit_code, 0);
}

TEST_F(OutputName, DashIsStandardOutput) {
  ASSERT_EQ(run({"export", store_, path("a.raw")}).exit_code, 0);
  ASSERT_EQ(run({"export", store_, path("a.nrrd")}).exit_code, 0);
  EXPECT_TRUE(streamed({"export", store_, "-"}) == read_file(path("a.raw")));
  EXPECT_TRUE(streamed({"export", store_, "-", "--format", "nrrd"}) == read_file(path("a.nrrd")));
  const Arguments roi{"--roi", "3:30,5:31,7:29"};
  ASSERT_EQ(run({"export", store_, path("part.raw"), roi[0], roi[1]}).exit_code, 0);
  EXPECT_TRUE(streamed({"export", store_, "-", roi[0], roi[1]}) == read_file(path("part.raw")));
  expect_refused(run({"export", store_, "-", "--format", "vdb"}), 2,
                 {"OpenVDB", "standard output"});
  const Outcome both = run({"export", store_, "-", "--json"});
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_EQ(nlohmann::json::parse(both.out, nullptr, false)["error"]["exit_code"], 2);
  EXPECT_FALSE(fs::exists("-"));
}

TEST_F(OutputName, DashIsAMeshOnStandardOutput) {
  const Arguments extract{"extract", store_, "--isovalue", "128", "-o"};
  for (const std::string format : {"obj", "ply", "stl", "glb", "vtp"}) {
    SCOPED_TRACE(format);
    Arguments to_file = extract, to_stream = extract;
    to_file.push_back(path("a." + format));
    to_stream.insert(to_stream.end(), {"-", "--format", format});
    ASSERT_EQ(run(to_file).exit_code, 0);
    EXPECT_TRUE(streamed(to_stream) == read_file(path("a." + format)));
  }
  Arguments unnamed = extract;
  unnamed.push_back("-");
  EXPECT_TRUE(streamed(unnamed) == read_file(path("a.ply")));
  EXPECT_EQ(files(),
            (std::vector<std::string>{"a.glb", "a.obj", "a.ply", "a.stl", "a.vtp", "a.zarr"}));
}

TEST_F(OutputName, DashWaitsInTheFolderOfTemporaryFiles) {
  const std::string program = path("run");
  write_file(program, "TMPDIR='" + path("no") + "' exec " ISOBRICK_PROGRAM " \"$@\"");
  write_file(path("stream"), "");
  const Outcome outcome =
      run_process({"sh", program, "extract", store_, "--isovalue", "128", "-o", "-"},
                  {.output = path("stream")});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.err.find("TMPDIR"), std::string::npos) << outcome.err;
  EXPECT_EQ(read_file(path("stream")), "");
}

TEST_F(OutputName, AReaderThatClosesThePipeIsAnError) {
  const auto cut = [&](const std::string& command) {
    write_file(path("run"), "{ " ISOBRICK_PROGRAM " " + command + "; echo $? > '" + path("code") +
                                "'; } | head -c 10 > /dev/null");
    const Outcome outcome = run_process({"sh", path("run")});
    EXPECT_EQ(read_file(path("code")), "1\n") << command;
    EXPECT_NE(outcome.err.find("Broken pipe"), std::string::npos) << outcome.err;
  };
  // More than a pipe holds.
  const std::string mesh = "extract '" + store_ + "' --isovalue 128 -o - --format ";
  for (const char* format : {"ply", "stl", "obj"}) cut(mesh + format);
  const std::string big = path("big.zarr");
  ASSERT_EQ(run({"synth", "gyroid", big, "--dims", "128,128,128", "--type", "u8"}).exit_code, 0);
  cut("export '" + big + "' -");
}

TEST_F(OutputName, DashIsAPictureOnStandardOutput) {
  ASSERT_EQ(run({"extract", store_, "--isovalue", "128", "-o", path("m.ply")}).exit_code, 0);
  const Arguments size{"--size", "80x60"};
  for (const Arguments& command :
       {Arguments{"render", path("m.ply"), "-o"},
        Arguments{"extract", store_, "--isovalue", "128", "--preview"},
        Arguments{"view", store_, "--isovalue", "128", "--screenshot"}}) {
    SCOPED_TRACE(command.front());
    Arguments to_file = command, to_stream = command;
    to_file.push_back(path("m.png"));
    to_stream.push_back("-");
    for (Arguments* arguments : {&to_file, &to_stream})
      arguments->insert(arguments->end(), size.begin(), size.end());
    const Outcome made = run(to_file);
    if (made.exit_code != 0) GTEST_SKIP() << made.err;
    EXPECT_TRUE(streamed(to_stream) == read_file(path("m.png")));
    fs::remove(path("m.png"));
  }
}

TEST_F(OutputName, AFullStandardOutputIsAnError) {
  const Outcome outcome = run({"export", store_, "-"}, {.output = "/dev/full"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.err.find("No space left"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace isobrick::test

#include "isobrick/render/gl_context.h"
#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

using ViewCommand = ProgramTest;

TEST_F(ViewCommand, NamesTheStoreThatIsMissingWithoutADisplay) {
  const Outcome outcome = run_process({"env", "-u", "DISPLAY", "-u", "WAYLAND_DISPLAY",
                                       ISOBRICK_PROGRAM, "view", path("none.zarr")});
  expect_refused(outcome, 1, {"none.zarr", "is no store"});
}

TEST_F(ViewCommand, AFolderThatCannotBeMadeIsNamed) {
  if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  write_file(path("file"), "");
  const Outcome outcome =
      run({"view", make_store("a"), "--turntable", path("file/turn"), "--frames", "2"});
  expect_refused(outcome, 1, {"cannot create the folder", "file/turn'", "Not a directory"});
}

TEST_F(ViewCommand, SaysThatAPictureIsCoarserThanAskedFor) {
  if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  run_json({"synth", "gyroid", path("g.zarr"), "--dims", "192,192,192", "--type", "u8"});
  const auto view = [&](const std::string& memory) {
    return run({"view", path("g.zarr"), "--screenshot", path("g.png"), "--size", "400x300",
                "--pixel-error", "0.5", "--memory", memory, "--force", "--no-occlusion"});
  };
  const Outcome coarse = view("184M"), fine = view("1G");
  EXPECT_EQ(coarse.exit_code, 0) << coarse.err;
  EXPECT_NE(coarse.err.find("--memory"), std::string::npos) << coarse.err;
  EXPECT_EQ(fine.exit_code, 0) << fine.err;
  EXPECT_EQ(fine.err.find("--memory"), std::string::npos) << fine.err;
}

}  // namespace
}  // namespace isobrick::test

#include <algorithm>
#include <csignal>
#include <filesystem>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// A second, and what a busy machine adds.
constexpr double kSoon = 2;

class Interrupt : public ProgramTest {
 protected:
  static Outcome interrupt(const Arguments& arguments, double after, int signal = SIGINT) {
    return run(arguments, {.interrupt_after = after, .interrupt_by = signal});
  }

  static void expect_ended_soon(const Outcome& outcome, const std::string& command, int signal) {
    EXPECT_EQ(outcome.signal, signal) << outcome.err;
    EXPECT_LT(outcome.seconds_since_signal, kSoon);
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_TRUE(outcome.err.starts_with("isobrick " + command + ": interrupted; ")) << outcome.err;
  }
};

// The encoder never looks up, and a brick of 16 MiB takes it long.
TEST_F(Interrupt, EncodingThatTakesLongEndsSoonAndSaysHowToGoOn) {
  const Arguments slow{"synth",   "gyroid",   path("a.zarr"), "--dims",    "256,256,256",
                       "--type",  "u8",       "--brick",      "256",       "--codec",
                       "zstd:22", "--memory", "2G",           "--threads", "2"};
  const Outcome outcome = interrupt(slow, 1.5, SIGTERM);
  expect_ended_soon(outcome, "synth", SIGTERM);
  EXPECT_NE(outcome.err.find("a.zarr.partial': the same command with --resume"), std::string::npos)
      << outcome.err;
  EXPECT_EQ(files(), std::vector<std::string>{"a.zarr.partial"});
}

TEST_F(Interrupt, AnIndexOfSmallItemsEndsSoonAndIsResumed) {
  const std::string store = path("a.zarr");
  ASSERT_EQ(run({"synth", "gyroid", store, "--dims", "400,400,400", "--type", "u8"}).exit_code, 0);
  Arguments slow{"index", store, "--kind", "kdtree", "--leaf", "1", "--threads", "1"};
  const Outcome outcome = interrupt(slow, 0.5);
  expect_ended_soon(outcome, "index", SIGINT);
  EXPECT_NE(outcome.err.find("--resume"), std::string::npos) << outcome.err;
  EXPECT_EQ(run_json({"info", store})["index_kinds"], nlohmann::json::array());
  slow.push_back("--resume");
  EXPECT_EQ(run(slow).exit_code, 0);
}

// Drivers draw a large picture in one go.
TEST_F(Interrupt, APictureThatTakesLongLeavesNothing) {
  const std::string store = make_store("a");
  ASSERT_EQ(run({"extract", store, "--isovalue", "127.5", "-o", path("a.ply")}).exit_code, 0);
  const std::vector<std::string> before = files();
  if (run({"render", path("a.ply"), "-o", path("b.png"), "--size", "64x64"}).exit_code != 0)
    GTEST_SKIP() << "no pictures here";
  fs::remove(path("b.png"));
  const Outcome outcome =
      interrupt({"render", path("a.ply"), "-o", path("b.png"), "--size", "4096x4096"}, 1);
  if (outcome.exit_code == 0) GTEST_SKIP() << "it was faster than the interrupt";
  expect_ended_soon(outcome, "render", SIGINT);
  EXPECT_EQ(files(), before);
}

}  // namespace
}  // namespace isobrick::test

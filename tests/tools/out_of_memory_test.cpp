#include <csignal>

#include <fmt/format.h>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

class OutOfMemory : public ProgramTest {
 protected:
  static Outcome run_without(long at, long length, const Arguments& arguments) {
    Arguments words{"env", "LD_PRELOAD=" ISOBRICK_ALLOCATION_FAULT,
                    fmt::format("ISOBRICK_FAULT_AT={}", at),
                    fmt::format("ISOBRICK_FAULT_LENGTH={}", length), ISOBRICK_PROGRAM};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return run_process(words);
  }

  /// Whichever allocation fails, alone or with all that follow, the program ends with a line. With
  /// `growth` the steps between those that are tried grow by that part of what lies before.
  static void expect_lines(const Arguments& arguments, long step, long growth = 0) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "a sanitizer has its own allocations";
#endif
    int refused = 0;
    for (const long length : {1L, 30L, 1L << 40}) {
      int whole = 0;
      for (long at = length % 7; whole < 3; at += step + (growth > 0 ? at / growth : 0)) {
        const Outcome outcome = run_without(at, length, arguments);
        // A message of the C library itself, where it starts a thread.
        if (outcome.err.find("glibc") != std::string::npos) continue;
        EXPECT_TRUE(outcome.exit_code == 0 || outcome.exit_code == 1)
            << arguments[0] << " without allocation " << at << " for " << length << ": signal "
            << outcome.signal << ' ' << outcome.err;
        whole += outcome.exit_code == 0;
        if (outcome.exit_code != 1) continue;
        ++refused;
        EXPECT_TRUE(outcome.err.starts_with("isobrick")) << outcome.err;
        EXPECT_EQ(outcome.err.find('\n') + 1, outcome.err.size()) << outcome.err;
      }
    }
    EXPECT_GT(refused, 30);
  }
};

TEST_F(OutOfMemory, AnExtractionEndsWithALine) {
  const std::string store = path("a.zarr");
  ASSERT_EQ(run({"synth", "gyroid", store, "--dims", "60,60,60", "--type", "u8", "--brick", "16"})
                .exit_code,
            0);
  expect_lines(
      {"extract", store, "--isovalue", "128", "-o", path("m.ply"), "--threads", "3", "--force"},
      61);
}

/// The commands but for extract, each on its own output that is there already.
class OutOfMemoryCommands : public OutOfMemory, public testing::WithParamInterface<const char*> {};

TEST_P(OutOfMemoryCommands, EndWithALine) {
  const std::string store = make_store("a", {"--build-index", "octree"});
  const std::string command = GetParam();
  write_file(path("a.raw"), noise(20 * 20 * 20));
  if (command == "convert")
    return expect_lines({"convert", path("a.raw"), store, "--dims", "20,20,20", "--type", "u8",
                         "--brick", "16", "--build-index", "octree", "--threads", "2", "--force"},
                        5, 5);
  if (command == "index")
    return expect_lines({"index", store, "--kind", "octree", "--threads", "2", "--force"}, 5, 5);
  if (command == "export")
    return expect_lines({"export", store, path("x.raw"), "--threads", "2", "--force"}, 5, 5);
  expect_lines({command, store}, 5, 5);
}

INSTANTIATE_TEST_SUITE_P(Commands, OutOfMemoryCommands,
                         testing::Values("convert", "index", "export", "info", "verify"),
                         [](const testing::TestParamInfo<const char*>& test) {
                           return std::string(test.param);
                         });

}  // namespace
}  // namespace isobrick::test

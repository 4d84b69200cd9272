#include <cerrno>
#include <csignal>
#include <cstdlib>

#include <fmt/format.h>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

/// A command whose last argument but options is a file that it writes.
struct Writer {
  Arguments words;
  std::string output;  ///< a name in the test's folder
};

class FullDisk : public ProgramTest {
 protected:
  FullDisk() {
    store_ = make_store("a", {"--build-index", "octree"});
    const auto made = run({"extract", store_, "--isovalue", "128", "-o", path("in.ply")});
    EXPECT_EQ(made.exit_code, 0) << made.err;
  }

  /// Every file that the program writes, each format once. Some may not be built.
  std::vector<Writer> writers() const {
    std::vector<Writer> all{{{"export", store_}, "out.raw"},
                            {{"export", store_}, "out.nrrd"},
                            {{"export", store_}, "out.vdb"},
                            {{"export", store_, "--isovalue", "128"}, "set.vdb"},
                            {{"synth", "gyroid", "--dims", "40,36,33", "--type", "u8"}, "s.raw"},
                            {{"render", path("in.ply"), "--size", "160x120", "-o"}, "out.png"}};
    for (const char* name : {"out.ply", "out.stl", "out.obj", "out.glb", "out.vtp", "out.pvtp"})
      all.push_back({{"extract", store_, "--isovalue", "128", "--no-space-check", "-o"}, name});
    return all;
  }

  Arguments with_output(const Writer& writer, const std::string& output) const {
    Arguments words = writer.words;
    words.push_back(output);
    words.push_back("--force");
    return words;
  }

  /// The program's words with faults injected, see write_fault.cpp.
  static Outcome run_with_fault(const Arguments& arguments, long long after, int fault,
                                int signal = 0) {
    Arguments words{"env", "LD_PRELOAD=" ISOBRICK_WRITE_FAULT,
                    fmt::format("ISOBRICK_FAULT_AFTER={}", after),
                    fmt::format("ISOBRICK_FAULT_ERRNO={}", fault),
                    fmt::format("ISOBRICK_FAULT_SIGNAL={}", signal),
                    // A sanitizer wants to be the first library.
                    "ASAN_OPTIONS=verify_asan_link_order=0", ISOBRICK_PROGRAM};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return run_process(words);
  }

  /// With every other write and read interrupted by a signal.
  static Outcome run_interrupted(const Arguments& arguments) {
    Arguments words{"env", "LD_PRELOAD=" ISOBRICK_WRITE_FAULT, "ISOBRICK_FAULT_INTERRUPTS=1",
                    "ASAN_OPTIONS=verify_asan_link_order=0", ISOBRICK_PROGRAM};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return run_process(words);
  }

  /// Whether the output can be made at all: a format or OpenGL may be missing.
  bool possible(const Writer& writer) const {
    const Outcome made = run(with_output(writer, path(writer.output)));
    EXPECT_TRUE(made.exit_code == 0 || writer.output.ends_with(".vdb") ||
                writer.output.ends_with(".png"))
        << made.err;
    return made.exit_code == 0;
  }

  std::string store_;
};

TEST_F(FullDisk, NothingTruncatedGetsAFinalNameAndNothingGoodIsReplaced) {
  for (const Writer& writer : writers()) {
    SCOPED_TRACE(writer.words[0] + ' ' + writer.output);
    if (!possible(writer)) continue;
    const std::string whole = read_file(path(writer.output));
    const std::vector<std::string> before = files();
    const auto size = static_cast<long long>(whole.size());
    for (const int fault : {ENOSPC, EIO})
      for (const long long after : {0LL, size / 2, size - 1}) {
        const Outcome outcome =
            run_with_fault(with_output(writer, path(writer.output)), after, fault);
        // Of text and of parts of scratch files a byte more or less may be written.
        if (outcome.exit_code == 0 && after == size - 1 && writer.output == "out.pvtp") continue;
        expect_refused(outcome, 1, {fault == EIO ? "Input/output error" : "No space left"});
        EXPECT_TRUE(read_file(path(writer.output)) == whole) << "after " << after;
        EXPECT_EQ(files(), before) << "after " << after;
      }
  }
}

TEST_F(FullDisk, WhatIsReportedOnlyWhenAFileIsClosedCountsToo) {
  for (const Writer& writer : writers()) {
    SCOPED_TRACE(writer.words[0] + ' ' + writer.output);
    if (!possible(writer)) continue;
    const std::string whole = read_file(path(writer.output));
    const std::vector<std::string> before = files();
    expect_refused(run_with_fault(with_output(writer, path(writer.output)), -1, EIO), 1,
                   {"Input/output error", writer.output});
    EXPECT_TRUE(read_file(path(writer.output)) == whole);
    EXPECT_EQ(files(), before);
  }
}

// Libraries write at their own pace, and the last bytes come when the work is done.
TEST_F(FullDisk, ASignalWhileAFileIsWrittenLeavesTheOneThatWasThere) {
  for (const Writer& writer : writers()) {
    SCOPED_TRACE(writer.words[0] + ' ' + writer.output);
    if (!possible(writer)) continue;
    const std::string whole = read_file(path(writer.output));
    const std::vector<std::string> before = files();
    for (const long long after : {0LL, static_cast<long long>(whole.size()) - 1}) {
      const Outcome outcome =
          run_with_fault(with_output(writer, path(writer.output)), after, EIO, SIGTERM);
      if (outcome.exit_code == 0 && after > 0 && writer.output == "out.pvtp") continue;
      EXPECT_EQ(outcome.signal, SIGTERM) << "after " << after;
      EXPECT_NE(outcome.err.find("interrupted"), std::string::npos) << outcome.err;
      EXPECT_TRUE(read_file(path(writer.output)) == whole) << "after " << after;
      EXPECT_EQ(files(), before) << "after " << after;
    }
  }
}

TEST_F(FullDisk, AStoreIsNotMadeOnOne) {
  write_file(path("in.raw"), noise(64 * 64 * 64));
  const Arguments convert{"convert", path("in.raw"), path("b.zarr"),  "--dims", "64,64,64",
                          "--type",  "u8",           "--build-index", "octree"};
  for (const int fault : {ENOSPC, EIO})
    for (const long long after : {0LL, 1000LL, 200'000LL}) {
      expect_refused(run_with_fault(convert, after, fault), 1,
                     {fault == EIO ? "Input/output error" : "No space left"});
      EXPECT_FALSE(std::filesystem::exists(path("b.zarr"))) << after;
      std::filesystem::remove_all(path("b.zarr.partial"));
    }
}

TEST_F(FullDisk, OfASmallFileSystem) {
  const std::string disk = path("disk");
  std::filesystem::create_directory(disk);
  const auto on_small_disk = [&](const std::string& command) {
    return run_process(
        {"unshare", "-r", "-m", "sh", "-c",
         fmt::format("mount -t tmpfs -o size=16k none '{}' || exit 77\n{}", disk, command)});
  };
  const int made = on_small_disk("exit 0").exit_code;
  if (made != 0) GTEST_SKIP() << "file systems cannot be mounted here";
  for (const Writer& writer : writers()) {
    SCOPED_TRACE(writer.words[0] + ' ' + writer.output);
    if (!possible(writer)) continue;
    if (std::filesystem::file_size(path(writer.output)) < 16384) continue;
    std::string command = ISOBRICK_PROGRAM;
    for (const std::string& word : with_output(writer, disk + '/' + writer.output))
      command += " '" + word + '\'';
    const Outcome outcome = on_small_disk(
        fmt::format("echo good > '{0}/{1}'; {2}; echo $? `cat '{0}/{1}'` `ls '{0}' | wc -l`", disk,
                    writer.output, command));
    EXPECT_EQ(outcome.out, "1 good 1\n") << outcome.err;
    // A field is not computed for a disk that it does not fit.
    const char* expected = writer.words[0] == "synth" ? "its disk has" : "No space left";
    EXPECT_NE(outcome.err.find(expected), std::string::npos) << outcome.err;
  }
}

TEST_F(FullDisk, InterruptedCallsAreRepeated) {
  write_file(path("a.raw"), noise(20 * 20 * 20));
  const Arguments convert{"convert", path("a.raw"), path("b.zarr"), "--dims", "20,20,20",
                          "--type",  "u8",          "--brick",      "16",     "--build-index",
                          "octree",  "--memory",    "40M",          "--force"};
  ASSERT_EQ(run(convert).exit_code, 0);
  const std::string store = path("b.zarr");
  const Arguments extract{"extract", store, "--isovalue", "128", "--force", "-o", path("m.ply")};
  const Arguments exported{"export", store, path("x.nrrd"), "--force"};
  for (const Arguments& words : {extract, exported}) ASSERT_EQ(run(words).exit_code, 0);
  const std::string mesh = read_file(path("m.ply")), samples = read_file(path("x.nrrd"));
  for (const Arguments& words : {convert, extract, exported}) {
    const Outcome outcome = run_interrupted(words);
    EXPECT_EQ(outcome.exit_code, 0) << words[0] << ": " << outcome.err;
  }
  EXPECT_TRUE(read_file(path("m.ply")) == mesh && read_file(path("x.nrrd")) == samples);
  EXPECT_EQ(run_interrupted({"verify", store}).exit_code, 0);
}

}  // namespace
}  // namespace isobrick::test

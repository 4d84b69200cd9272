#include <filesystem>

#include <fmt/format.h>

#include "tests/tools/program.h"

// Meshes of labels for which the disk has no room.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class LabelSpace : public ProgramTest {
 protected:
  LabelSpace() : store_(path("cells.zarr")), disk_(path("disk")) {
    fs::create_directory(disk_);
    run_json({"synth", "cells", store_, "--dims", "60,50,40", "--type", "u8"});
    const auto made =
        run_json({"extract", store_, "--labels", "all", "--format", "stl", "-o", path("whole")});
    scratch_ = made["scratch_bytes"].get<std::uint64_t>();
    meshes_ = made["output_bytes"].get<std::uint64_t>();
  }

  /// The program with a disk of so many bytes, which only the process sees; what it leaves there
  /// but pieces for another run is added to the errors.
  Outcome run_on_disk(std::uint64_t bytes, const Arguments& arguments) const {
    std::string command = ISOBRICK_PROGRAM;
    for (const std::string& word : arguments) command += " '" + word + '\'';
    return run_process({"unshare", "--user", "--map-root-user", "--mount", "sh", "-c",
                        fmt::format("mount -t tmpfs -o size={} none '{}' || exit 77; {}; code=$?; "
                                    "ls -A '{}' | grep -v pieces >&2; "
                                    "exit $code",
                                    bytes, disk_, command, disk_)});
  }
  bool has_disks() const { return run_on_disk(65536, {"--version"}).exit_code == 0; }

  std::string store_, disk_;
  std::uint64_t scratch_ = 0, meshes_ = 0;  ///< bytes
};

TEST_F(LabelSpace, MeshesThatDoNotFitAreNotBegun) {
  if (!has_disks()) GTEST_SKIP() << "no disk of its own for a process here";
  ASSERT_GT(meshes_, scratch_);
  const std::string folder = disk_ + "/out";
  Arguments extract{"extract", store_, "--labels", "all", "--format", "stl", "-o", folder};
  const std::uint64_t small = scratch_ + meshes_ / 2;
  expect_refused(run_on_disk(small, extract), 1,
                 {"out' will have", " but its disk has ", "--no-space-check"});
  // What fits is made; headers and rest of disk blocks take more.
  EXPECT_EQ(run_on_disk(scratch_ + 2 * meshes_, extract).exit_code, 0);
  extract.push_back("--no-space-check");
  expect_refused(run_on_disk(small, extract), 1, {"No space left"});
}

TEST_F(LabelSpace, PiecesAreNotMergedWhereTheirScratchFileDoesNotFit) {
  if (!has_disks()) GTEST_SKIP() << "no disk of its own for a process here";
  const std::string piece = path("a.piece"), folder = disk_ + "/out";
  run_json({"extract", store_, "--labels", "all", "--part", "1/1", "-o", piece});
  Arguments merge{"merge", piece, "--format", "stl", "-o", folder};
  for (const std::uint64_t small : {scratch_ / 2, scratch_ + meshes_ / 2})
    expect_refused(run_on_disk(small, merge), 1,
                   {"out' will have", " but its disk has ", "--no-space-check"});
  EXPECT_EQ(run_on_disk(scratch_ + 2 * meshes_, merge).exit_code, 0);
  merge.push_back("--no-space-check");
  expect_refused(run_on_disk(scratch_ / 2, merge), 1, {"No space left"});
}

TEST_F(LabelSpace, NorByWayOfPieces) {
  if (!has_disks()) GTEST_SKIP() << "no disk of its own for a process here";
  const Arguments resume{"extract", store_, "--labels",     "all",     "--format",
                         "stl",     "-o",   disk_ + "/out", "--resume"};
  // The piece fits, its copy as a scratch file does, the meshes do not.
  expect_refused(run_on_disk(2 * scratch_ + meshes_ / 2, resume), 1,
                 {"out' will have", " but its disk has "});
}

}  // namespace
}  // namespace isobrick::test

#include "core/machine_memory.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>

#include "tests/temporary_folder.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;
constexpr std::uint64_t kNone = std::numeric_limits<std::uint64_t>::max();

void write(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

TEST(MachineMemory, TheLeastLimitOfNestedGroupsOfVersion2) {
  const test::TemporaryFolder root;
  write(root / "memory.max", "max\n");
  write(root / "slurm/memory.max", "1048576000\n");
  write(root / "slurm/job7/memory.max", "max\n");
  const std::string path = (root / "").string();
  EXPECT_EQ(control_group_memory("0::/slurm/job7\n", path), 1048576000u);
  EXPECT_EQ(control_group_memory("0::/\n", path), kNone);
  write(root / "slurm/job7/memory.max", "4096\n");
  EXPECT_EQ(control_group_memory("0::/slurm/job7\n", path), 4096u);
  EXPECT_EQ(control_group_memory("0::/slurm\n", path), 1048576000u);
}

TEST(MachineMemory, GroupsOfVersion1AreInTheFolderOfTheirController) {
  const test::TemporaryFolder root;
  write(root / "memory/docker/a/memory.limit_in_bytes", "33554432\n");
  const std::string path = (root / "").string();
  EXPECT_EQ(control_group_memory("3:cpu,cpuacct:/x\n2:hugetlb,memory:/docker/a\n", path),
            32 * kMiB);
  EXPECT_EQ(control_group_memory("3:cpu,cpuacct:/docker/a\n", path), kNone);
  EXPECT_EQ(control_group_memory("", path), kNone);
  EXPECT_EQ(control_group_memory("nonsense\n", path), kNone);
}

TEST(MachineMemory, TheDefaultIsAQuarterButHalfOfLittle) {
  EXPECT_EQ(default_memory_budget(512 * kMiB), 256 * kMiB);
  EXPECT_EQ(default_memory_budget(3072 * kMiB), 1024 * kMiB);
  EXPECT_EQ(default_memory_budget(8192 * kMiB), 2048 * kMiB);
  EXPECT_EQ(default_memory_budget(524288 * kMiB), 131072 * kMiB);
}

TEST(MachineMemory, ThisMachineHasSome) {
  EXPECT_GT(allowed_memory(), 64 * kMiB);
  EXPECT_LT(allowed_memory(), kNone);
}

}  // namespace
}  // namespace isobrick

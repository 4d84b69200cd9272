#include "filters/scratch_array.h"

#include <sys/resource.h>

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <isobrick/error.h>
#include <isobrick/vec.h>
#include "tests/temporary_folder.h"

namespace isobrick::test {
namespace {

using Numbers = ScratchArray<std::uint32_t>;

/// Sixteen numbers a page.
ScratchPlace small_pages() { return {.page_bytes = 64}; }

std::vector<std::uint32_t> all_of(Numbers& numbers) {
  std::vector<std::uint32_t> all;
  numbers.for_each_run([&](std::span<const std::uint32_t> run, std::uint64_t first) {
    EXPECT_EQ(first, all.size());
    all.insert(all.end(), run.begin(), run.end());
  });
  return all;
}

// Random reads, writes and appends do what they do to a vector, whatever is resident.
TEST(ScratchArray, IsAVectorWithAnyBudget) {
  for (const std::uint64_t memory : {0u, 64u, 128u, 1024u, 1u << 20}) {
    Numbers numbers(small_pages(), memory);
    std::vector<std::uint32_t> expected;
    std::mt19937 engine(7);
    const auto random = [&] { return static_cast<std::uint32_t>(engine()); };
    for (int step = 0; step < 20000; ++step) {
      if (expected.empty() || random() % 4 == 0) {
        expected.push_back(random());
        numbers.push_back(expected.back());
        continue;
      }
      const std::size_t i = random() % expected.size();
      if (random() % 2 == 0) numbers.edit(i) = expected[i] = random();
      ASSERT_EQ(numbers[i], expected[i]) << "budget " << memory << ", step " << step;
    }
    EXPECT_EQ(all_of(numbers), expected);
    EXPECT_LE(numbers.resident_pages(), std::max<std::uint64_t>(1, memory / 64));
  }
}

TEST(ScratchArray, HoldsItsBudgetAndNotTheArray) {
  constexpr std::uint64_t budget = 1 << 20;
  ScratchArray<std::uint64_t> numbers({}, budget);
  for (std::uint64_t i = 0; i < (4 << 20); ++i) numbers.push_back(i * i);
  EXPECT_EQ(numbers.resident_pages() * (64 << 10), budget);
  EXPECT_GE(numbers.file_bytes() + budget, numbers.size() * 8);
  for (std::uint64_t i = 0; i < numbers.size(); i += 4099) ASSERT_EQ(numbers[i], i * i);
}

TEST(ScratchArray, NeedsNoFileForWhatFits) {
  Numbers numbers({.beside = "/no such folder/mesh.ply"}, 1 << 20);
  for (std::uint32_t i = 0; i < 100000; ++i) numbers.push_back(i);
  EXPECT_EQ(numbers.file_bytes(), 0u);
  EXPECT_EQ(numbers[99999], 99999u);
}

TEST(ScratchArray, NewElementsAreZero) {
  Numbers numbers(small_pages(), 128);
  numbers.resize(1000);
  numbers.edit(999) = 5;
  for (std::uint64_t i = 0; i < 999; ++i) ASSERT_EQ(numbers[i], 0u);
  EXPECT_EQ(numbers[999], 5u);
  // What the file held before does not come back.
  numbers.edit_runs([](std::span<std::uint32_t> run, std::uint64_t) {
    for (std::uint32_t& number : run) number = 9;
  });
  numbers.clear();
  EXPECT_TRUE(numbers.empty());
  numbers.resize(1000);
  numbers.edit(999) = 5;
  EXPECT_EQ(numbers[500], 0u);
}

// A page holds a power of two of elements, so some of its bytes stay unused.
TEST(ScratchArray, TakesElementsOfAnySize) {
  ScratchArray<Vec3f> rows({.page_bytes = 100}, 300);
  std::vector<Vec3f> expected;
  for (int i = 0; i < 1000; ++i) expected.push_back({float(i), float(2 * i), float(3 * i)});
  rows.append(std::span(expected).first(333));
  rows.append(std::span(expected).subspan(333));
  for (std::size_t i = 0; i < expected.size(); ++i)
    ASSERT_EQ(rows[(i * 7) % 1000], expected[(i * 7) % 1000]);
}

TEST(ScratchArray, RunsOfAPartBeginAndEndInPages) {
  Numbers numbers(small_pages(), 64);
  for (std::uint32_t i = 0; i < 100; ++i) numbers.push_back(i);
  std::vector<std::uint32_t> part;
  numbers.for_each_run(5, 70, [&](std::span<const std::uint32_t> run, std::uint64_t) {
    part.insert(part.end(), run.begin(), run.end());
  });
  ASSERT_EQ(part.size(), 65u);
  EXPECT_EQ(part.front(), 5u);
  EXPECT_EQ(part.back(), 69u);
  numbers.for_each_run(7, 7, [](auto, std::uint64_t) { FAIL() << "an empty run"; });
}

TEST(ScratchArray, LeavesNoFile) {
  const TemporaryFolder folder;
  {
    Numbers numbers({.beside = (folder / "mesh.ply").string(), .page_bytes = 64}, 64);
    for (std::uint32_t i = 0; i < 1000; ++i) numbers.push_back(i);
    EXPECT_GT(numbers.file_bytes(), 0u);
    EXPECT_TRUE(std::filesystem::is_empty(folder / ""));
    numbers.release();
    EXPECT_EQ(numbers.size(), 0u);
    EXPECT_EQ(numbers.file_bytes(), 0u);
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder / ""));
}

TEST(ScratchArray, NamesAFolderThatCannotBeWrittenTo) {
  Numbers numbers({.beside = "/no such folder/mesh.ply", .page_bytes = 64}, 64);
  try {
    for (std::uint32_t i = 0; i < 1000; ++i) numbers.push_back(i);
    FAIL() << "written to nowhere";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("/no such folder"), std::string::npos) << error.what();
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
}

// A limit on the size of files stands for a disk that is full.
TEST(ScratchArray, ReportsADiskThatIsFull) {
  const TemporaryFolder folder;
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{std::size_t{16} << 10, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  std::string message;
  {
    Numbers numbers({.beside = (folder / "mesh.ply").string(), .page_bytes = 64}, 64);
    try {
      for (std::uint32_t i = 0; i < 100000; ++i) numbers.push_back(i);
    } catch (const Error& error) {
      message = error.what();
    }
  }
  ::setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_NE(message.find("cannot write '" + (folder / "mesh.ply").string() + "': "),
            std::string::npos)
      << message;
  EXPECT_TRUE(std::filesystem::is_empty(folder / ""));
}

}  // namespace
}  // namespace isobrick::test

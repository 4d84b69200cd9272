#include "io/bytes/file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <array>
#include <limits>

#include "temp_dir.h"

namespace isobrick::inline v0 {
namespace {

TEST(File, ReadsAtOffsets) {
  const TempDir dir;
  dir.write("a", "0123456789");
  const File file = open_input(dir / "a");
  std::array<char, 4> bytes;
  file.read_at(3, std::as_writable_bytes(std::span(bytes)));
  EXPECT_EQ(std::string(bytes.data(), bytes.size()), "3456");
  EXPECT_EQ(file.size(), 10u);
  EXPECT_EQ(file.text_at(8, 100), "89");
  EXPECT_EQ(file.text_at(2, 3), "234");
  EXPECT_EQ(file.text_at(11, 1), "");
  EXPECT_EQ(file.text_at(std::numeric_limits<std::uint64_t>::max(), 1), "");
}

TEST(File, NamesPathAndOffsetWhereItEnds) {
  const TempDir dir;
  dir.write("a", "0123456789");
  const File file = open_input(dir / "a");
  std::array<std::byte, 4> bytes;
  EXPECT_EQ(message_of<DamageError>([&] { file.read_at(8, bytes); }),
            quoted(std::filesystem::path(dir / "a")) + " ends at offset 10, 2 bytes too early");
  const std::uint64_t behind = std::uint64_t{1} << 63;
  EXPECT_TRUE(contains(message_of<DamageError>([&] { file.read_at(behind, bytes); }),
                       "offset 9223372036854775808 is out of bounds"));
}

TEST(File, InputsAreRegularFiles) {
  const TempDir dir;
  ASSERT_EQ(::mkfifo((dir / "pipe").c_str(), 0600), 0);
  EXPECT_TRUE(contains(message_of<Error>([&] { open_input(dir / "none"); }), "cannot open"));
  EXPECT_TRUE(contains(message_of<UsageError>([&] { open_input(dir / "."); }), "is a directory"));
  EXPECT_TRUE(contains(message_of<UsageError>([&] { open_input(dir / "pipe"); }),
                       "is not a regular file (a pipe can be given as standard input, '-')"));
}

TEST(File, FilesOfAStoreMayBeMissing) {
  const TempDir dir;
  ASSERT_EQ(::mkfifo((dir / "pipe").c_str(), 0600), 0);
  EXPECT_FALSE(open_if_exists(dir / "none"));
  for (const char* name : {".", "pipe"})
    EXPECT_TRUE(contains(message_of<DamageError>([&] { open_if_exists(dir / name); }),
                         "is not a regular file"));
}

TEST(File, SmallFilesHaveALimit) {
  const TempDir dir;
  dir.write("a", "0123456789");
  EXPECT_EQ(read_small_file(dir / "none", 10), std::nullopt);
  EXPECT_EQ(read_small_file(dir / "a", 10), "0123456789");
  EXPECT_TRUE(contains(message_of<DamageError>([&] { read_small_file(dir / "a", 9); }),
                       "has 10 bytes, more than the 9 that make sense"));
}

}  // namespace
}  // namespace isobrick

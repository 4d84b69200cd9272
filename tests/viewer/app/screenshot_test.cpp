#include "viewer/app/screenshot.h"

#include <gtest/gtest.h>

#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

TEST(FreeName, IsThatOfNoFile) {
  const TempDir dir;
  EXPECT_EQ(free_name(dir / "a.png"), dir / "a.png");
  dir.write("a.png", "");
  EXPECT_EQ(free_name(dir / "a.png"), dir / "a-2.png");
  std::filesystem::create_symlink("nowhere", dir / "a-2.png");
  EXPECT_EQ(free_name(dir / "a.png"), dir / "a-3.png");
  EXPECT_EQ(free_name("no such file.png"), "no such file.png");
}

}  // namespace
}  // namespace isobrick

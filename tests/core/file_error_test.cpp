#include "core/file_error.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <system_error>

namespace isobrick::inline v0 {
namespace {

TEST(ErrorMessage, NamesWhatToDoWhereNoThreadStarts) {
  const std::system_error error(std::make_error_code(std::errc::resource_unavailable_try_again));
  EXPECT_NE(error_message(error).find("try fewer --threads"), std::string::npos);
}

TEST(ErrorMessage, OfFilesIsPutAsOurs) {
  const std::filesystem::filesystem_error error(
      "x", "a.raw", std::make_error_code(std::errc::no_such_file_or_directory));
  EXPECT_EQ(error_message(error), "cannot use 'a.raw': No such file or directory");
  EXPECT_EQ(error_message(std::runtime_error("plain")), "plain");
}

}  // namespace
}  // namespace isobrick

#pragma once

#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <utility>

#include <isobrick/open_source.h>
#include "io/volumes/raw/text_header.h"
#include "test_samples.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {

/// Tests of one format of headers, whose data file is v.raw: 7×5×4 samples of
/// i16, big endian.
class HeaderTest : public ::testing::Test {
 protected:
  using Parser = TextHeader (*)(const std::string& path, const Selection& selection);

  /// `plain` is a header without anything that may be left out.
  HeaderTest(Parser parser, std::string name, std::string plain)
      : parser_(parser), name_(std::move(name)), plain_(std::move(plain)) {}

  TextHeader parse(std::string_view text) const {
    return parser_(dir.write(name_, text), selection);
  }
  /// The message that refuses a header; it names the file.
  std::string refuse(std::string_view text) const {
    const auto message = message_of([&] { parse(text); });
    EXPECT_TRUE(contains(message, name_)) << message;
    return message;
  }
  /// The plain header with one piece replaced.
  std::string with(std::string_view piece, std::string_view other) const {
    std::string text = plain_;
    return text.replace(text.find(piece), piece.size(), other);
  }

  void expect_plain(const TextHeader& header) const {
    EXPECT_EQ(header.view.extent, extent);
    EXPECT_EQ(header.type, ScalarType::i16);
    EXPECT_EQ(header.order, ByteOrder::big);
    EXPECT_EQ(header.data_paths, std::vector<std::string>{dir / "v.raw"});
    EXPECT_EQ(header.transform, Transform{});
  }
  /// One of 100 MiB is refused by its size.
  void expect_huge_header_is_refused() const {
    dir.write(name_, plain_.substr(0, plain_.size() - 1));  // the last line goes on and on
    std::filesystem::resize_file(dir / name_, 100 << 20);
    EXPECT_TRUE(contains(message_of([&] { parser_(dir / name_, {}); }), "104857600"));
  }
  /// Headers whose sizes 7 5 4 are `sizes` are not opened.
  void expect_sizes_are_refused(std::initializer_list<const char*> all) const {
    dir.write("v.raw", "");
    for (const char* sizes : all) {
      dir.write(name_, with("7 5 4", sizes));
      message_of([&] { open_source(dir / name_, {}); });
    }
  }

  Selection selection;
  const Int3 extent{7, 5, 4};
  const Box3 whole{{0, 0, 0}, extent};
  TempDir dir;

 private:
  Parser parser_;
  std::string name_, plain_;
};

}  // namespace isobrick

#include "io/bytes/inflate.h"

#include <gtest/gtest.h>

#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "packed.h"

namespace isobrick::inline v0 {
namespace {

/// What inflate() makes of `packed`, and the text in an output of `room` bytes.
std::pair<InflateResult, std::string> unpack(bool gzip, std::string_view packed, std::size_t room) {
  std::string out(room, '\0');
  const InflateResult done =
      inflate(gzip ? Wrapper::gzip : Wrapper::zlib, std::as_bytes(std::span(packed)),
              std::as_writable_bytes(std::span(out)));
  out.resize(done.size);
  return {done, out};
}

std::string sample_text() {
  std::string text;
  for (int i = 0; i < 20000; ++i) text += std::to_string(i * i % 977);
  return text;
}

TEST(Inflate, FillsItsOutput) {
  const std::string text = sample_text();
  for (const bool gzip : {true, false})
    for (const int level : {0, 1, 9}) {
      const std::string packed = pack(text, gzip, level);
      for (const std::size_t spare : {0, 1, 100}) {
        const auto [done, out] = unpack(gzip, packed, text.size() + spare);
        EXPECT_EQ(done.status, InflateResult::Status::complete);
        EXPECT_EQ(done.code, 0);
        EXPECT_EQ(done.filled(text.size() + spare), spare == 0);
        EXPECT_EQ(out, text);
      }
    }
}

TEST(Inflate, TakesTheFirstMember) {
  const auto [done, out] = unpack(true, pack("first", true) + pack("second", true), 100);
  EXPECT_EQ(done.status, InflateResult::Status::complete);
  EXPECT_EQ(out, "first");
}

TEST(Inflate, ReportsHowAStreamEnds) {
  const std::string text = sample_text();
  for (const bool gzip : {true, false})
    for (const int level : {0, 6}) {
      const std::string packed = pack(text, gzip, level);
      for (const std::size_t room : {std::size_t{0}, std::size_t{1}, text.size() - 1})
        EXPECT_EQ(unpack(gzip, packed, room).first.status, InflateResult::Status::no_room) << room;
      for (std::size_t size = 0; size < packed.size(); size += 1 + size / 2)
        EXPECT_EQ(unpack(gzip, packed.substr(0, size), text.size()).first.status,
                  InflateResult::Status::cut_off)
            << size;
      std::string damaged = packed;
      damaged[packed.size() - 5] = static_cast<char>(
          damaged[packed.size() - 5] ^ 1);  // gzip's checksum, or the last bits of zlib's data
      const InflateResult done = unpack(gzip, damaged, text.size()).first;
      EXPECT_NE(done.status, InflateResult::Status::complete);
      EXPECT_FALSE(done.filled(text.size()));
    }
  EXPECT_EQ(unpack(true, "no deflate stream at all", 100).first.status,
            InflateResult::Status::invalid);
  EXPECT_LT(unpack(false, "no deflate stream at all", 100).first.code, 0);
}

}  // namespace
}  // namespace isobrick

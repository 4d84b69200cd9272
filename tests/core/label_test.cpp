#include <isobrick/label.h>

#include <gtest/gtest.h>

#include <array>
#include <limits>

namespace isobrick::testing {
namespace {

constexpr std::uint64_t kTop = std::numeric_limits<std::uint64_t>::max();
constexpr std::int64_t kBottom = std::numeric_limits<std::int64_t>::min();

TEST(Label, AreEqualAndOrderedAsIntegers) {
  const std::array<Label, 9> ascending{kBottom,
                                       kBottom + 1,
                                       -1,
                                       0,
                                       std::uint8_t{7},
                                       std::numeric_limits<std::int64_t>::max(),
                                       std::uint64_t{1} << 63,
                                       kTop - 1,
                                       kTop};
  for (std::size_t i = 0; i < ascending.size(); ++i)
    for (std::size_t j = 0; j < ascending.size(); ++j) {
      EXPECT_EQ(ascending[i] < ascending[j], i < j) << i << " " << j;
      EXPECT_EQ(ascending[i] == ascending[j], i == j) << i << " " << j;
    }
  EXPECT_EQ(Label(), 0);
  EXPECT_EQ(Label(std::int8_t{5}), Label(std::uint64_t{5}));
  EXPECT_NE(Label(-1), Label(kTop)) << "the same bits";
}

TEST(Label, HaveAllDigits) {
  for (const char* text : {"0", "7", "-1", "9223372036854775807", "9223372036854775808",
                           "18446744073709551615", "-9223372036854775808"}) {
    const auto label = Label::parse(text);
    ASSERT_TRUE(label.has_value()) << text;
    EXPECT_EQ(label->text(), text);
  }
  EXPECT_EQ(Label::parse("-0"), Label(0));
  EXPECT_EQ(Label::parse("007"), Label(7));
  for (const char* text : {"", "-", "+1", " 1", "1 ", "1.0", "1e3", "0x1", "--1", "x",
                           "18446744073709551616", "-9223372036854775809"})
    EXPECT_FALSE(Label::parse(text).has_value()) << text;
}

TEST(Label, AreIntegersOfOneSignOrBoth) {
  EXPECT_EQ(Label(kTop).as_unsigned(), kTop);
  EXPECT_EQ(Label(kTop).as_signed(), std::nullopt);
  EXPECT_EQ(Label(std::uint64_t{1} << 63).as_signed(), std::nullopt);
  EXPECT_EQ(Label(kBottom).as_signed(), kBottom);
  EXPECT_EQ(Label(kBottom).as_unsigned(), std::nullopt);
  EXPECT_EQ(Label(kBottom).bits(), std::uint64_t{1} << 63);
  EXPECT_EQ(Label(-1).bits(), kTop);
  EXPECT_EQ(Label(7).as_signed(), 7);
  EXPECT_EQ(Label(7).as_unsigned(), 7u);
  EXPECT_EQ(static_cast<double>(Label(kTop)), 0x1p64);
  EXPECT_EQ(static_cast<double>(Label(kBottom)), -0x1p63);
}

}  // namespace
}  // namespace isobrick::testing

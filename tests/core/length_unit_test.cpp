#include "isobrick/core/length_unit.h"

#include <gtest/gtest.h>

namespace isobrick {
namespace {

TEST(LengthUnit, SymbolsBecomeNamesAndBack) {
  for (const char* symbol : {"m", "dm", "cm", "mm", "nm", "pm", "km", "in", "ft", "mi"}) {
    const std::string name = unit_name(symbol);
    EXPECT_GT(name.size(), 3u) << symbol;
    EXPECT_EQ(unit_name(name), name);
    EXPECT_EQ(unit_symbol(name), symbol);
    EXPECT_EQ(ascii_unit_symbol(name), symbol);
  }
}

TEST(LengthUnit, PeopleReadGreekAndFilesAscii) {
  for (const char* text : {"um", "\u00b5m", "\u03bcm", "micron", "micrometer"})
    EXPECT_EQ(unit_name(text), "micrometer");
  EXPECT_EQ(unit_symbol("micrometer"), "\u00b5m");
  EXPECT_EQ(ascii_unit_symbol("micrometer"), "um");
  EXPECT_EQ(unit_symbol("angstrom"), "\u00c5");
  EXPECT_EQ(ascii_unit_symbol("angstrom"), "angstrom");
}

TEST(LengthUnit, WhatIsUnknownKeepsItsNameOrIsNone) {
  EXPECT_EQ(unit_name("gigameter"), "gigameter");
  EXPECT_EQ(unit_symbol("gigameter"), "gigameter");
  EXPECT_EQ(unit_name("second"), "");
  EXPECT_EQ(unit_symbol(""), "");
}

TEST(LengthUnit, RatiosAreExact) {
  EXPECT_EQ(unit_ratio("inch", "millimeter"), 25.4);
  EXPECT_EQ(unit_ratio("meter", "micrometer"), 1e6);
  EXPECT_EQ(unit_ratio("parsec", "parsec"), 1);
  EXPECT_FALSE(unit_ratio("parsec", "meter"));
}

}  // namespace
}  // namespace isobrick

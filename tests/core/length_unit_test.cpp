#include "core/length_unit.h"

#include <gtest/gtest.h>

namespace isobrick::inline v0 {
namespace {

TEST(LengthUnit, SymbolsBecomeNamesAndBack) {
  for (const char* symbol :
       {"m",  "dm", "cm", "mm", "nm", "pm", "km", "in", "ft", "mi", "yd", "fm",
        "am", "zm", "ym", "hm", "Mm", "Gm", "Tm", "Pm", "Em", "Zm", "Ym", "pc"}) {
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

TEST(LengthUnit, OtherSpellings) {
  EXPECT_EQ(unit_name("microns"), "micrometer");
  EXPECT_EQ(unit_name("millimetres"), "millimeter");
  EXPECT_EQ(unit_name("inches"), "inch");
  EXPECT_EQ(unit_name("feet"), "foot");
}

/// Only of names: Mm is no mm.
TEST(LengthUnit, NamesMayHaveCapitals) {
  for (const char* text : {"Millimeter", "MILLIMETER", "millimeter", "Millimetres"})
    EXPECT_EQ(unit_name(text), "millimeter") << text;
  EXPECT_EQ(unit_name("Microns"), "micrometer");
  EXPECT_EQ(unit_name("Inches"), "inch");
  EXPECT_EQ(unit_name("Feet"), "foot");
  EXPECT_EQ(unit_name("Mm"), "megameter");
  for (const char* text : {"MM", "UM", "Nm", "CM"}) EXPECT_EQ(unit_name(text), "") << text;
}

TEST(LengthUnit, WhatIsUnknownIsNone) {
  for (const char* text : {"pixel", "kilogrammeter", "MM", "mms", "s", ""})
    EXPECT_EQ(unit_name(text), "") << text;
  EXPECT_EQ(unit_symbol("pixel"), "pixel");
  EXPECT_NE(unit_names().find("angstrom, mile"), std::string::npos);
  EXPECT_EQ(unit_name("second"), "");
  EXPECT_EQ(unit_symbol(""), "");
}

TEST(LengthUnit, RatiosAreExact) {
  EXPECT_EQ(unit_ratio("inch", "millimeter"), 25.4);
  EXPECT_EQ(unit_ratio("meter", "micrometer"), 1e6);
  EXPECT_EQ(unit_ratio("parsec", "parsec"), 1);
  EXPECT_FALSE(unit_ratio("pixel", "meter"));
}

}  // namespace
}  // namespace isobrick

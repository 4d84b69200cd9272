#include <isobrick/isovalue.h>

#include <gtest/gtest.h>

#include <isobrick/error.h>

namespace isobrick::test {
namespace {

using Kind = IsovalueRequest::Kind;
using Requests = std::vector<IsovalueRequest>;

/// Of integers 10 to 19 with these counts.
Histogram integers(std::vector<std::uint64_t> counts) {
  Histogram h;
  h.lo = h.first = 10;
  h.hi = 10 + static_cast<double>(counts.size()) - 1;
  h.bin_width = 1;
  h.whole_numbers = true;
  h.counts = std::move(counts);
  return h;
}

double resolve(const char* text, const Histogram& h, ScalarType type = ScalarType::i16) {
  return resolve_isovalue(parse_isovalues(text).at(0), h, type);
}

TEST(Isovalue, Grammar) {
  EXPECT_EQ(parse_isovalues("300"), (Requests{{Kind::value, 300}}));
  EXPECT_EQ(parse_isovalues("-1.5e3,+2"), (Requests{{Kind::value, -1500}, {Kind::value, 2}}));
  EXPECT_EQ(parse_isovalues("otsu,p99.5,50%"),
            (Requests{{Kind::otsu, 0}, {Kind::percentile, 99.5}, {Kind::percent_of_range, 50}}));
  EXPECT_EQ(parse_isovalues("300HU,ct-bone"),
            (Requests{{Kind::hounsfield, 300}, {Kind::hounsfield, 226}}));
  EXPECT_EQ(parse_isovalues("100:200:50"),
            (Requests{{Kind::value, 100}, {Kind::value, 150}, {Kind::value, 200}}));
  EXPECT_EQ(parse_isovalues("2:1:-0.5").size(), 3u);
  EXPECT_EQ(parse_isovalues("1, 2 "), (Requests{{Kind::value, 1}, {Kind::value, 2}}));
  EXPECT_EQ(parse_isovalues("0.1:0.35:0.05")[1].number, 0.15);
  EXPECT_EQ(parse_isovalues("0:1:0.1").size(), 11u) << "rounding takes no last step away";
  EXPECT_EQ(parse_isovalues("0:1:0.3").size(), 4u);
}

TEST(Isovalue, WhatIsNone) {
  for (const char* text : {"",      ",",       "1,",  "bone", "ct-",   "p",       "pp",    "p101",
                           "p-1",   "101%",    "%",   "x%",   "HU",    "1:2",     "1:2:0", "2:1:1",
                           "1:2:x", "0:1e9:1", "nan", "inf",  "1 2 3", "otsu:1:2"})
    EXPECT_THROW(parse_isovalues(text), UsageError) << text;
  try {
    parse_isovalues("bone");
  } catch (const UsageError& error) {
    EXPECT_NE(std::string(error.what()).find("ct-bone (226 HU)"), std::string::npos)
        << error.what();
  }
}

TEST(Isovalue, OfSamples) {
  const Histogram h = integers({50, 30, 0, 0, 0, 0, 0, 0, 10, 10});
  EXPECT_EQ(resolve("otsu", h), 11.5) << "between the classes, equal to no sample";
  EXPECT_EQ(resolve("p50", h), 10);
  EXPECT_EQ(resolve("p95", h), 19);
  EXPECT_EQ(resolve("0%", h), 10);
  EXPECT_EQ(resolve("50%", h), 14.5);
  EXPECT_EQ(resolve("100%", h), 19);
  EXPECT_EQ(resolve("17", h), 17);
}

TEST(Isovalue, HounsfieldUnitsNeedASign) {
  const Histogram h = integers({1, 1});
  for (const ScalarType type : {ScalarType::i16, ScalarType::f32, ScalarType::i32})
    EXPECT_EQ(resolve("ct-bone", h, type), 226);
  EXPECT_THROW(resolve("300HU", h, ScalarType::u16), UsageError);
}

TEST(Isovalue, OfSamplesThatHaveNone) {
  EXPECT_THROW(resolve("otsu", integers({7})), UsageError);
  EXPECT_EQ(resolve("p50", integers({7})), 10);
  for (const char* text : {"otsu", "p50", "50%", "300HU"})
    EXPECT_THROW(resolve(text, Histogram{}), UsageError) << text;
  EXPECT_EQ(resolve("3", Histogram{}), 3);
}

TEST(Isovalue, Suggestions) {
  StoreInfo info;
  info.type = ScalarType::u8;
  std::vector<std::uint64_t> many(100, 1);
  many[0] = 500;
  EXPECT_EQ(suggest_isovalue(info, integers({5, 0, 3, 1}))->value, 11) << "labels 10, 12 and 13";
  const auto otsu = suggest_isovalue(info, integers(many));
  EXPECT_EQ(otsu->value, resolve("otsu", integers(many)));
  EXPECT_NE(otsu->why.find("Otsu"), std::string::npos);
  EXPECT_FALSE(suggest_isovalue(info, integers({7})));
  EXPECT_FALSE(suggest_isovalue(info, Histogram{}));
  info.grid_class = "level set";
  EXPECT_EQ(suggest_isovalue(info, integers(many))->value, 0);
}

}  // namespace
}  // namespace isobrick::test

#include "io/volumes/raw/meta_image_header.h"

#include <gtest/gtest.h>

#include "header_fixture.h"

namespace isobrick::inline v0 {
namespace {

constexpr const char* kPlain =
    "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = True\n"
    "DimSize = 7 5 4\nElementType = MET_SHORT\nElementDataFile = v.raw\n";

class MetaImageHeader : public HeaderTest {
 protected:
  MetaImageHeader() : HeaderTest(parse_meta_image_header, "v.mhd", kPlain) {}

  /// The data file ends a header, so lines are added in front of it.
  std::string plus(const std::string& lines) const {
    return with("ElementDataFile", lines + "ElementDataFile");
  }
};

TEST_F(MetaImageHeader, Plain) {
  expect_plain(parse(kPlain));
  EXPECT_EQ(parse(with("BinaryDataByteOrderMSB = True", "ElementByteOrderMSB=False")).order,
            ByteOrder::little);
}

TEST_F(MetaImageHeader, ReadsSamplesThroughEitherName) {
  dir.write("v.raw", "12345678" + sample_bytes(ScalarType::i16, whole, extent, true));
  for (const char* skip : {"HeaderSize = 8\n", "HeaderSize = -1\n"})
    for (const char* name : {"v.mhd", "v.raw"}) {
      dir.write("v.mhd", plus(skip));
      EXPECT_EQ(read_box(*open_source(dir / name, {}), whole),
                sample_bytes(ScalarType::i16, whole, extent));
    }
}

TEST_F(MetaImageHeader, Types) {
  const std::pair<const char*, ScalarType> types[] = {
      {"MET_UCHAR", ScalarType::u8},       {"MET_CHAR", ScalarType::i8},
      {"MET_USHORT", ScalarType::u16},     {"MET_SHORT", ScalarType::i16},
      {"MET_UINT", ScalarType::u32},       {"MET_INT", ScalarType::i32},
      {"MET_ULONG_LONG", ScalarType::u64}, {"MET_LONG_LONG", ScalarType::i64},
      {"MET_FLOAT", ScalarType::f32},      {"MET_DOUBLE", ScalarType::f64}};
  for (const auto& [name, type] : types) EXPECT_EQ(parse(with("MET_SHORT", name)).type, type);
  for (const char* name : {"MET_LONG", "MET_ULONG", "MET_UCHAR_ARRAY", "uint8", ""})
    refuse(with("MET_SHORT", name));
}

TEST_F(MetaImageHeader, Geometry) {
  const auto header =
      parse(plus("TransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = 10 20 -30\n"
                 "ElementSpacing = 2 3 0.5\nDistanceUnits = mm\n"));
  EXPECT_EQ(header.transform.spacing, (Vec3d{2, 3, 0.5}));
  EXPECT_EQ(header.transform.apply({1, 1, 2}), (Vec3d{7, 22, -29}));
  EXPECT_EQ(header.transform.unit, "millimeter");
  EXPECT_EQ(parse(plus("ElementSize = 4 4 4\nPosition = 1 2 3\n")).transform.origin,
            (Vec3d{1, 2, 3}));
  EXPECT_EQ(parse(plus("ElementSize = 4 4 4\n")).transform.spacing, (Vec3d{4, 4, 4}));
}

TEST_F(MetaImageHeader, RefusesWhatIsNotSupportedByName) {
  EXPECT_TRUE(contains(refuse(plus("ElementNumberOfChannels = 3\n")), "3 channels"));
  EXPECT_TRUE(contains(refuse(with("NDims = 3", "NDims = 2")), "NDims"));
  EXPECT_TRUE(contains(refuse(with("NDims = 3", "NDims = 5")), "NDims"));
  EXPECT_TRUE(contains(refuse(with("= v.raw", "= LIST")), "empty"));
  EXPECT_NO_THROW(parse(plus("CompressedData = False\nElementNumberOfChannels = 1\n")));
}

TEST_F(MetaImageHeader, RefusesToLeaveItsFolder) {
  for (const char* name :
       {"/etc/passwd", "../v.raw", "a/../../v.raw", "LIST\na.raw\n../b.raw", "../v%02d.raw 1 9 1"})
    EXPECT_TRUE(contains(refuse(with("v.raw", name)), "outside")) << name;
}

TEST_F(MetaImageHeader, HostileHeaders) {
  refuse("");
  refuse("no equals sign");
  EXPECT_TRUE(contains(refuse(plus(std::string("a = \0\n", 6))), "NUL"));
  EXPECT_TRUE(contains(refuse(plus("DimSize = 1 1 1\n")), "twice"));
  EXPECT_TRUE(contains(refuse(with("DimSize = 7 5 4\n", "")), "'DimSize' is missing"));
  EXPECT_TRUE(contains(refuse(with("ElementType = MET_SHORT\n", "")), "'ElementType' is missing"));
  EXPECT_TRUE(contains(refuse(with("ElementDataFile = v.raw\n", "")), "'ElementDataFile'"));
  EXPECT_TRUE(contains(refuse(with("7 5 4", "7 5 9223372036854775808")), "too large"));
  refuse(with("7 5 4", "7 5"));
  refuse(with("= v.raw", "="));
  refuse(with("= True", "= maybe"));
  refuse(plus("HeaderSize = -2\n"));
  refuse(plus("ElementSpacing = 1 -1 1\n"));
  refuse(plus("Offset = 1 2\n"));
  refuse(plus("Offset = 1 2 nan\n"));
  refuse(plus("TransformMatrix = 0 0 0 0 0 0 0 0 0\n"));
}

TEST_F(MetaImageHeader, HostileSizesAreRefusedWhenOpened) {
  expect_sizes_are_refused({"-7 5 4", "0 5 4", "9223372036854775807 2 2"});
}

TEST_F(MetaImageHeader, AHugeHeaderIsNotRead) { expect_huge_header_is_refused(); }

}  // namespace
}  // namespace isobrick

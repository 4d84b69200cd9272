#include "io/volumes/raw/nrrd_header.h"

#include <gtest/gtest.h>

#include "header_fixture.h"

namespace isobrick::inline v0 {
namespace {

constexpr const char* kPlain =
    "NRRD0004\n# a comment\ntype: short\ndimension: 3\nsizes: 7 5 4\nencoding: raw\n"
    "endian: big\ndata file: v.raw\nkey with blanks:=value: with colon\n";

class NrrdHeader : public HeaderTest {
 protected:
  NrrdHeader() : HeaderTest(parse_nrrd_header, "v.nhdr", kPlain) {}
};

TEST_F(NrrdHeader, Plain) { expect_plain(parse(kPlain)); }

TEST_F(NrrdHeader, ReadsSamplesThroughEitherName) {
  dir.write("v.raw", "head\nmore\nxyz" + sample_bytes(ScalarType::i16, whole, extent, true));
  dir.write("v.nhdr", std::string(kPlain) + "line skip: 2\nbyte skip: 3\n");
  for (const char* name : {"v.nhdr", "v.raw"}) {
    const auto source = open_source(dir / name, {});
    EXPECT_EQ(read_box(*source, whole), sample_bytes(ScalarType::i16, whole, extent));
  }
  dir.write("v.nhdr", std::string(kPlain) + "byteskip: -1\n");
  EXPECT_EQ(read_box(*open_source(dir / "v.nhdr", {}), whole),
            sample_bytes(ScalarType::i16, whole, extent));
  dir.write("v.nhdr", std::string(kPlain) + "line skip: 99999999999\n");
  EXPECT_TRUE(contains(message_of([&] { open_source(dir / "v.nhdr", {}); }), "lines"));
  dir.write("v.nhdr", std::string(kPlain) + "byte skip: 9223372036854775807\n");
  message_of([&] { open_source(dir / "v.nhdr", {}); });
}

TEST_F(NrrdHeader, AllSpellingsOfTypes) {
  const std::pair<ScalarType, std::vector<const char*>> all[] = {
      {ScalarType::i8, {"signed char", "int8", "int8_t"}},
      {ScalarType::u8, {"uchar", "unsigned char", "uint8", "uint8_t", "UCHAR"}},
      {ScalarType::i16, {"short", "short int", "signed short", "signed short int", "int16"}},
      {ScalarType::u16, {"ushort", "unsigned short", "unsigned short int", "uint16_t"}},
      {ScalarType::i32, {"int", "signed int", "int32", "int32_t"}},
      {ScalarType::u32, {"uint", "unsigned int", "uint32", "uint32_t"}},
      {ScalarType::i64,
       {"longlong", "long long", "long long int", "signed long long", "signed long long int",
        "int64", "int64_t"}},
      {ScalarType::u64,
       {"ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"}},
      {ScalarType::f32, {"float"}},
      {ScalarType::f64, {"double"}},
  };
  for (const auto& [type, names] : all)
    for (const char* name : names)
      EXPECT_EQ(parse(with("type: short", std::string("type: ") + name)).type, type) << name;
  for (const char* name : {"block", "int128", "", "half"})
    refuse(with("type: short", std::string("type: ") + name));
}

TEST_F(NrrdHeader, SegmentsOfSlicer) {
  const std::string segments =
      "Segmentation_MasterRepresentation:=Binary labelmap\n"
      "Segment0_ID:=a\nSegment0_Name:=Großhirn\nSegment0_LabelValue:=7\n"
      "Segment0_Color:=0.5 0 1\nSegment0_Layer:=0\nSegment0_Extent:=0 6 0 4 0 3\n"
      "Segment1_ID:=b\nSegment1_Name:=spleen\nSegment1_LabelValue:=2\nSegment1_Color:=2 0 0\n"
      "Segment1_Layer:=1\nSegment2_ID:=c\nSegment2_Name:=\xff\nSegment2_LabelValue:=-4\n"
      "Segment3_ID:=d\nSegment3_LabelValue:=x\nSegment4_ID:=e\nSegment4_LabelValue:=7\n"
      "Segment6_ID:=none\nSegment6_LabelValue:=1\n";
  const TextHeader plain = parse(kPlain + segments);
  ASSERT_TRUE(plain.labels);
  EXPECT_EQ(*plain.labels, (LabelTable{{-4, "?", {}}, {7, "Großhirn", {{128, 0, 255, 255}}}}))
      << "the first of those with one value; none of another layer";
  EXPECT_FALSE(parse(kPlain).labels);
  EXPECT_TRUE(parse(std::string(kPlain) + "Segment0_ID:=a\n").labels->empty());
  const std::string layers = with("dimension: 3\nsizes: 7 5 4",
                                  "dimension: 4\nsizes: 2 7 5 4\nkinds: list domain domain "
                                  "domain") +
                             segments;
  refuse(layers);
  selection.channel = 1;
  EXPECT_EQ(*parse(layers).labels, (LabelTable{{2, "spleen", {}}}));
}

TEST_F(NrrdHeader, Geometry) {
  const auto spacings =
      parse(std::string(kPlain) + "spacings: 0.5 nan 2e0\nunits: \"um\" \"um\" \"um\"\n");
  EXPECT_EQ(spacings.transform.spacing, (Vec3d{0.5, 1, 2}));
  EXPECT_EQ(spacings.transform.unit, "micrometer");
  const auto capitals =
      parse(std::string(kPlain) + "units: \"Millimeter\" \"MILLIMETER\" \"mm\"\n");
  EXPECT_EQ(capitals.transform.unit, "millimeter");
  EXPECT_EQ(parse(std::string(kPlain) + "units: \"MM\" \"MM\" \"MM\"\n").transform.unit, "");

  const auto turned = parse(std::string(kPlain) +
                            "space: left-posterior-superior\n"
                            "space directions: (0,2,0) (-3, 0, 0) (0,0,0.5)\n"
                            "space origin: (10,20,-30)\nspace units: \"mm\" \"mm\" \"mm\"\n");
  EXPECT_EQ(turned.transform.spacing, (Vec3d{2, 3, 0.5}));
  EXPECT_EQ(turned.transform.direction, (std::array<double, 9>{0, -1, 0, 1, 0, 0, 0, 0, 1}));
  EXPECT_EQ(turned.transform.apply({1, 1, 2}), (Vec3d{7, 22, -29}));
  EXPECT_EQ(turned.transform.unit, "millimeter");
}

TEST_F(NrrdHeader, FourDimensionsWithOneOfSizeOne) {
  const auto header = parse(
      "NRRD0005\r\ntype: uint8\r\ndimension: 4\r\nsizes: 1 7 5 4\r\nencoding: RAW\r\n"
      "space dimension: 3\r\nspace directions: none (1,0,0) (0,2,0) (0,0,3)\r\n"
      "datafile: sub/v.raw\r\n\r\nignored after the blank line");
  EXPECT_EQ(header.view.extent, (Int3{7, 5, 4}));
  EXPECT_EQ(header.transform.spacing, (Vec3d{1, 2, 3}));
  EXPECT_EQ(header.data_paths[0], dir / "sub/v.raw");
  EXPECT_TRUE(
      contains(refuse("NRRD0004\ntype: uint8\ndimension: 4\nsizes: 3 7 5 4\nencoding: raw\n"),
               "4 dimensions, and neither"));
}

TEST_F(NrrdHeader, RefusesWhatIsNotSupportedByName) {
  for (const char* encoding : {"bzip2", "hex"})
    EXPECT_TRUE(
        contains(refuse(with("encoding: raw", std::string("encoding: ") + encoding)), encoding));
  EXPECT_TRUE(contains(refuse(with("dimension: 3", "dimension: 2")), "dimension 2"));
  EXPECT_TRUE(contains(refuse(std::string(kPlain) + "space directions: (1,0,0) (1,1,0) (0,0,1)\n"),
                       "right angles"));
}

TEST_F(NrrdHeader, RefusesToLeaveItsFolder) {
  for (const char* name : {"/etc/passwd", "../v.raw", "a/../../v.raw", "..",
                           "LIST\nv.raw\n../w.raw", "../v%d.raw 1 3 1", "/v%d.raw 1 3 1"})
    EXPECT_TRUE(contains(refuse(with("v.raw", name)), "outside")) << name;
}

TEST_F(NrrdHeader, HostileHeaders) {
  EXPECT_TRUE(contains(refuse(""), "NRRD"));
  refuse("NRRD0009\n");
  refuse("NRRD0004");
  EXPECT_TRUE(contains(refuse(std::string(kPlain) + std::string("content: a\0b\n", 13)), "NUL"));
  EXPECT_TRUE(contains(refuse(std::string(kPlain) + "sizes: 1 1 1\n"), "twice"));
  EXPECT_TRUE(contains(refuse(with("sizes: 7 5 4\n", "")), "'sizes' is missing"));
  EXPECT_TRUE(contains(refuse(with("type: short\n", "")), "'type' is missing"));
  EXPECT_TRUE(contains(refuse(with("encoding: raw\n", "")), "'encoding' is missing"));
  EXPECT_TRUE(contains(refuse(with("7 5 4", "7 5 9223372036854775808")), "too large"));
  refuse(with("7 5 4", "7 5"));
  refuse(with("7 5 4", "7 5 4 3"));
  refuse(with("7 5 4", "7 5 4.5"));
  refuse(with("endian: big", "endian: middle"));
  refuse(std::string(kPlain) + "no colon here\n");
  refuse(std::string(kPlain) + "spacings: 1 0 1\n");
  refuse(std::string(kPlain) + "spacings: 1 inf 1\n");
  refuse(std::string(kPlain) + "byte skip: -2\n");
  refuse(std::string(kPlain) + "space directions: (1,0,0) (0,1,0 (0,0,1)\n");
  refuse(std::string(kPlain) + "space directions: (1,0,0) (0,0,0) (0,0,1)\n");
  refuse(std::string(kPlain) + "space origin: (1,2)\n");
}

TEST_F(NrrdHeader, HostileSizesAreRefusedWhenOpened) {
  expect_sizes_are_refused(
      {"-7 5 4", "0 5 4", "9223372036854775807 2 2", "3000000000 3000000000 3000000000"});
}

TEST_F(NrrdHeader, AHugeHeaderIsNotRead) { expect_huge_header_is_refused(); }

TEST_F(NrrdHeader, AMissingByteOrderMustBeSaid) {
  dir.write("v.raw", std::string(280, 'x'));
  dir.write("v.nhdr", with("endian: big\n", ""));
  EXPECT_TRUE(contains(message_of([&] { open_source(dir / "v.nhdr", {}); }), "endian"));
  VolumeRequest request;
  request.order = ByteOrder::little;
  EXPECT_NO_THROW(open_source(dir / "v.nhdr", request));
}

TEST_F(NrrdHeader, AMissingDataFileIsNamed) {
  dir.write("v.nhdr", kPlain);
  EXPECT_TRUE(contains(message_of<Error>([&] { open_source(dir / "v.nhdr", {}); }), "v.raw"));
}

}  // namespace
}  // namespace isobrick

#include <gtest/gtest.h>

#include <array>
#include <cstdio>

#include <isobrick/open_source.h>
#include "damaged_files.h"
#include "test_samples.h"
#include "tests/io/bytes/base64_text.h"
#include "tests/io/bytes/packed.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

constexpr Int3 kExtent{7, 5, 4};
constexpr Box3 kWhole{{0, 0, 0}, kExtent};

std::string number(std::uint32_t value) {
  std::string bytes(4, '\0');
  std::memcpy(bytes.data(), &value, 4);
  return bytes;
}

/// The table and the blocks of `bytes`, as VTK compresses them.
std::pair<std::string, std::string> blocks(const std::string& bytes, std::size_t block) {
  const std::size_t count = (bytes.size() + block - 1) / block;
  std::string sizes = number(static_cast<std::uint32_t>(count)) +
                      number(static_cast<std::uint32_t>(block)) +
                      number(static_cast<std::uint32_t>(bytes.size() % block));
  std::string packed;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string one = pack(bytes.substr(i * block, block), false);
    sizes += number(static_cast<std::uint32_t>(one.size()));
    packed += one;
  }
  return {sizes, packed};
}

struct Parts {
  std::string file = "byte_order=\"LittleEndian\" compressor=\"vtkZLibDataCompressor\"";
  std::string extent = "0 6 0 4 0 3";
  std::string array = "type=\"Int16\" Name=\"a\" format=\"appended\" offset=\"0\"/";
  std::string appended = "raw\">\n _";
  std::string data;

  std::string text() const {
    return "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"0.1\" " + file +
           ">\n<ImageData WholeExtent=\"" + extent +
           "\" Origin=\"1 2 3\" Spacing=\"1 2 0.5\"><Piece Extent=\"" + extent +
           "\"><PointData Scalars=\"a\"><DataArray " + array +
           "></PointData></Piece></ImageData><AppendedData encoding=\"" + appended + data +
           "</AppendedData></VTKFile>";
  }
};

class Vtk : public ::testing::Test {
 protected:
  std::unique_ptr<VolumeSource> open(const std::string& bytes, const VolumeRequest& request = {}) {
    return open_source(dir.write("v.vtx", bytes), request);  // known by its content alone
  }
  /// Opens and reads, which must fail with one line that names the file.
  std::string refuse(const std::string& bytes) {
    try {
      const auto source = open(bytes);
      read_box(*source, {{0, 0, 0}, min(kExtent, source->info().extent)});
    } catch (const Error& error) {
      EXPECT_TRUE(contains(error.what(), "v.vtx")) << error.what();
      EXPECT_FALSE(contains(error.what(), "\n")) << error.what();
      return error.what();
    }
    ADD_FAILURE() << "read: " << bytes.substr(0, 400);
    return {};
  }
  static std::string samples(bool swap = false) {
    return sample_bytes(ScalarType::i16, kWhole, kExtent, swap);
  }

  TempDir dir;
};

class VtkXml : public Vtk {
 protected:
  void SetUp() override {
#ifndef ISOBRICK_WITH_EXPAT
    EXPECT_TRUE(contains(message_of([&] { open(Parts{}.text()); }), "built without"));
    GTEST_SKIP() << "built without expat";
#endif
    const auto [sizes, packed] = blocks(samples(), 64);
    parts.data = sizes + packed;
  }

  Parts parts;
};

TEST_F(VtkXml, ReadsCompressedBlocks) {
  const auto source = open(parts.text());
  EXPECT_EQ(read_box(*source, kWhole), samples());
  EXPECT_EQ(source->info().transform.origin, (Vec3d{1, 2, 3}));
  EXPECT_EQ(source->info().transform.spacing, (Vec3d{1, 2, 0.5}));
  const auto [sizes, packed] = blocks(samples(), 56);  // no shorter block at the end
  parts.data = base64(sizes) + base64(packed);
  parts.appended = "base64\">_";
  EXPECT_EQ(read_box(*open(parts.text()), kWhole), samples());
  parts.array = "type=\"Int16\" Name=\"a\" format=\"binary\">\n" + base64(sizes) + base64(packed) +
                "\n</DataArray";
  parts.appended = "raw\">_";
  EXPECT_EQ(read_box(*open(parts.text()), kWhole), samples());
}

TEST_F(VtkXml, ReadsPlainSamples) {
  parts.file = "byte_order=\"LittleEndian\"";
  parts.data = number(280) + samples();
  EXPECT_TRUE(open(parts.text())->random_access());
  EXPECT_EQ(read_box(*open(parts.text()), kWhole), samples());
  parts.appended = "base64\"> _";
  parts.data = base64(number(280) + samples());
  EXPECT_EQ(read_box(*open(parts.text()), kWhole), samples());
  parts.data = base64(number(280)) + base64(samples());
  EXPECT_EQ(read_box(*open(parts.text()), kWhole), samples());
}

TEST_F(VtkXml, AWrongByteOrderIsNamedAsACauseOfAWrongSize) {
  parts.file = "byte_order=\"BigEndian\"";
  parts.data = number(280) + samples();
  const std::string message = refuse(parts.text());
  EXPECT_TRUE(contains(message, "402718720 bytes")) << message;
  EXPECT_TRUE(contains(message, "byte_order")) << message;
}

// VTK's writer repeats the whole extent in each requested piece.
TEST_F(VtkXml, OfInlinePiecesTheFirstIsReadIfItIsTheWhole) {
  const auto with_two_pieces = [](std::string text) {
    const std::size_t begin = text.find("<Piece"), end = text.find("</ImageData>");
    return text.insert(end, text.substr(begin, end - begin));
  };
  EXPECT_TRUE(contains(refuse(with_two_pieces(parts.text())), "several pieces"));
  parts.file = "byte_order=\"LittleEndian\"";
  parts.array = "type=\"Int16\" Name=\"a\" format=\"binary\">" + base64(number(280) + samples()) +
                "</DataArray";
  std::string text = with_two_pieces(parts.text());
  EXPECT_EQ(read_box(*open(text), kWhole), samples());
  text.replace(text.find("Piece Extent=\"0 6"), 17, "Piece Extent=\"0 3");
  EXPECT_TRUE(contains(refuse(text), "not the whole extent"));
}

TEST_F(VtkXml, CellDataLieAtTheCentres) {
  std::string text = parts.text();
  for (const char* tag : {"<PointData", "</PointData"})
    text.replace(text.find(tag) + std::string(tag).size() - 9, 9, "CellData");
  const std::size_t at = text.find("0 6 0 4 0 3");
  text.replace(at, 11, "0 7 0 5 0 4");
  text.replace(text.find("0 6 0 4 0 3"), 11, "0 7 0 5 0 4");
  const auto source = open(text);
  EXPECT_EQ(source->info().extent, kExtent);
  EXPECT_EQ(source->info().transform.origin, (Vec3d{1.5, 3, 3.25}));
  EXPECT_EQ(read_box(*source, kWhole), samples());
}

TEST_F(VtkXml, HostileFiles) {
  const Parts good = parts;
  const auto with = [&](auto change) {
    Parts changed = good;
    change(changed);
    return refuse(changed.text());
  };
  const auto extent = [&](const char* text) { return with([&](Parts& p) { p.extent = text; }); };
  extent("0 6 0 4");
  extent("0 -9 0 4 0 3");
  extent("0 9223372036854775807 0 4 0 3");
  extent("-9223372036854775808 9223372036854775807 0 4 0 3");
  extent("0 2000000000 0 2000000000 0 2000000000");
  EXPECT_TRUE(contains(extent("0 6 0 4 0 30"), "at most"));
  extent("0 6 0 4 0 2");
  with([](Parts& p) { p.array = "type=\"Int64\" Name=\"a\" format=\"appended\" offset=\"0\"/"; });
  with([](Parts& p) { p.array = "type=\"Int16\" Name=\"b\" format=\"appended\" offset=\"0\"/"; });
  for (const char* offset : {"-1", "9223372036854775807", "99999999999999999999", "x", "1"})
    with([&](Parts& p) {
      p.array =
          std::string("type=\"Int16\" Name=\"a\" format=\"appended\" offset=\"") + offset + "\"/";
    });
  EXPECT_TRUE(contains(with([](Parts& p) {
                         p.array = "type=\"Int16\" Name=\"a\" format=\"appended\" offset=\"x\"/";
                       }),
                       "the offset 'x' of the array 'a' is no place"));
  for (const char* count : {"0", "-1", "3", "9223372036854775807"})
    with(
        [&](Parts& p) { p.array.insert(0, std::string("NumberOfComponents=\"") + count + "\" "); });
  with([](Parts& p) { p.file = "compressor=\"vtkLZ4DataCompressor\""; });
  with([](Parts& p) { p.file += " header_type=\"UInt16\""; });
  for (std::size_t at = 0; at < 12; at += 4)
    for (const std::uint32_t value : {0u, 1u, 0x7fffffffu, 0xffffffffu})
      if (!(at == 8 && value == 0)) with([&](Parts& p) { p.data.replace(at, 4, number(value)); });
  for (std::size_t at = 12; at < good.data.size(); at += 5)
    with([&](Parts& p) { p.data[at] = static_cast<char>(p.data[at] ^ 0x55); });
  const std::string text = good.text();
  for (std::size_t size = 10; size < text.size() - 40; size += 7) {
    const std::string cut = text.substr(0, size);
    if (contains(cut, "<VTKFile")) refuse(cut);
  }
  std::string bomb = text;
  bomb.insert(22, "<!DOCTYPE a [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;\">]>");
  EXPECT_TRUE(contains(refuse(bomb), "DOCTYPE"));
  refuse("<VTKFile " + std::string(8 << 20, 'a'));
  refuse("<VTKFile type=\"PolyData\"></VTKFile>");
}

const std::string kLegacy =
    "# vtk DataFile Version 3.0\ntitle\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS 7 5 4\n"
    "SPACING 1 2 0.5\nORIGIN 1 2 3\nPOINT_DATA 140\nSCALARS s short\nLOOKUP_TABLE default\n";

TEST_F(Vtk, Legacy) {
  const auto source = open(kLegacy + samples(true) + "\nMETADATA\n");
  EXPECT_EQ(source->info().transform.origin, (Vec3d{1, 2, 3}));
  EXPECT_EQ(source->info().transform.spacing, (Vec3d{1, 2, 0.5}));
  EXPECT_EQ(read_box(*source, kWhole), samples());
  std::string field = kLegacy;
  field.replace(field.find("SCALARS"), std::string::npos, "FIELD f 1\ns 1 140 short\n");
  EXPECT_EQ(read_box(*open(field + samples(true)), kWhole), samples());
}

/// What VTK 9 writes of an image with field data: numbers, texts, bits, identifiers, metadata.
TEST_F(Vtk, LegacyFieldDataAreSkipped) {
  using namespace std::string_literals;
  const std::string binary =
      "FIELD FieldData 6\nTimeValue 1 1 float\n\x3f\xc0\0\0\n"
      "note%20s 1 3 string\n\xcdhello world\nx\x80\x41"s +
      std::string(65, 'a') + "\xcdPOINT_DATA 60\nd 3 2 double\n"s + std::string(48, '\x0a') +
      "\nMETADATA\nCOMPONENT_NAMES\nxx\n\n\n\n\nb 1 11 bit\n\x55\x40\nids 1 1 vtkIdType\n"
      "\0\0\0\x07\nlongs 1 2 long\n"s +
      std::string(16, '\0') + "\nMETADATA\nINFORMATION 0\n\n";
  const std::string text =
      "FIELD FieldData 5\nTimeValue 1 1 float\n1.5 \nnote%20s 1 3 string\nhello%20world%0Ax\n\n"
      "POINT_DATA%2060\n\nd 3 2 double\n1 2 3 10 2 3 \nMETADATA\nCOMPONENT_NAMES\nxx\n\n\n\n"
      "b 1 11 bit\n0 1 0 1 0 1 0 1\n0 1 0 \nids 1 0 vtkIdType\n\n";
  const auto with_field = [](const std::string& header, const std::string& field) {
    std::string whole = header;
    return whole.insert(whole.find("DIMENSIONS"), field);
  };
  EXPECT_EQ(read_box(*open(with_field(kLegacy, binary) + samples(true)), kWhole), samples());
  std::string numbers, ascii = kLegacy;
  ascii.replace(ascii.find("BINARY"), 6, "ASCII");
  for (std::size_t i = 0; i < samples().size(); i += 2) {
    std::int16_t sample;
    std::memcpy(&sample, samples().data() + i, 2);
    numbers += std::to_string(sample) + "\n";
  }
  EXPECT_EQ(read_box(*open(with_field(ascii, text) + numbers), kWhole), samples());
  for (const char* field :
       {"FIELD f\n", "FIELD f x\n", "FIELD f 2\na 1 1 float\n1234\n", "FIELD f 1\na -1 1 float\n",
        "FIELD f 1\na 1 9999999999 float\n", "FIELD f 1\na 1 1 variant\n",
        "FIELD f 1\na 1 1000 double\n1\n", "FIELD f 1\ns 1 1 string\n\x3f"})
    refuse(with_field(kLegacy, field) + samples(true));
}

TEST_F(Vtk, LegacyColoursAsTextAreFractionsOf255) {
  const std::string header =
      "# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 16 16 8\n"
      "POINT_DATA 2048\nCOLOR_SCALARS c 1\n";
  std::string text, bytes;
  for (int i = 0; i < 2048; ++i) {
    char word[32];
    std::snprintf(word, sizeof(word), "%g ",
                  static_cast<double>(static_cast<float>(i % 256) / 255.0f));
    text += word;
    bytes += static_cast<char>(i % 256);
  }
  const auto source = open(header + text);
  EXPECT_EQ(source->info().type, ScalarType::u8);
  EXPECT_EQ(read_box(*source, {{0, 0, 0}, {16, 16, 8}}), bytes);
  EXPECT_TRUE(contains(refuse(header + "1.5 " + text), "not from 0 to 1"));
  EXPECT_TRUE(contains(refuse(header + "-0.5 " + text), "not from 0 to 1"));
  EXPECT_TRUE(contains(refuse(header + "nan " + text), "not from 0 to 1"));
  refuse(header + "0.5 0.25");
}

TEST_F(Vtk, HostileLegacyFiles) {
  const auto with = [&](const char* piece, const char* other) {
    std::string text = kLegacy;
    return refuse(text.replace(text.find(piece), std::string(piece).size(), other) + samples(true));
  };
  with("7 5 4", "7 5");
  with("7 5 4", "-7 5 4");
  with("7 5 4", "9223372036854775807 9223372036854775807 2");
  with("7 5 4", "7 5 9223372036854775808");
  with("POINT_DATA 140", "POINT_DATA 141");
  with("POINT_DATA 140\n", "");
  with("short", "long");
  with("short", "short 0");
  with("short", "short 3");
  with("STRUCTURED_POINTS", "POLYDATA");
  with("SCALARS", "VECTORS");
  with("BINARY", "ROT13");
  with("SPACING 1", "SPACING nan");
  with("SPACING 1", "SPACING 0");
  std::string ascii = kLegacy;
  ascii.replace(ascii.find("BINARY"), 6, "ASCII");
  refuse(ascii + "1 2 3");
  refuse(ascii + std::string(600, 'x'));
  for (std::size_t size = 14; size < kLegacy.size(); ++size) refuse(kLegacy.substr(0, size));
  refuse(kLegacy + samples().substr(1));
}

TEST_F(VtkXml, Mutations) {
  expect_mutations_are_no_crash(dir, "m.vti", parts.text());
  const auto [sizes, packed] = blocks(samples(), 64);
  parts.data = base64(sizes) + base64(packed);
  parts.appended = "base64\">_";
  expect_mutations_are_no_crash(dir, "m.vti", parts.text());
}

TEST_F(Vtk, LegacyMutations) {
  expect_mutations_are_no_crash(dir, "m.vtk", kLegacy + samples(true));
}

}  // namespace
}  // namespace isobrick

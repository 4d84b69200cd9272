#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>

#ifdef ISOBRICK_WITH_HDF5
#include <hdf5.h>
#endif
#ifdef ISOBRICK_WITH_TIFF
#include <tiffio.h>
#endif

#include <isobrick/error.h>
#include <isobrick/open_source.h>
#include "io/bytes/byte_order.h"
#include "test_samples.h"
#include "tests/io/bytes/base64_text.h"
#include "tests/io/bytes/packed.h"
#include "tests/io/bytes/temp_dir.h"

// 64-bit integers, which stay what they are.
namespace isobrick::inline v0 {
namespace {

constexpr Int3 kSize{3, 2, 2};
constexpr Box3 kAll{{0, 0, 0}, kSize};
using Values = std::array<std::int64_t, 12>;
constexpr std::int64_t kLargest = std::int64_t{1} << 53;
constexpr Values kPlain{0, 1, 2, 300, 70000, 5, 6, 1LL << 40, 8, kLargest, kLargest << 5, 11};

/// The values as they are stored; u64 has the same bits.
std::string stored_bytes(const Values& values, bool swapped = false) {
  std::string bytes(sizeof values, '\0');
  std::memcpy(bytes.data(), values.data(), sizeof values);
  if (swapped) swap_byte_order(reinterpret_cast<std::byte*>(bytes.data()), values.size(), 8);
  return bytes;
}

std::string as_text(const Values& values, bool is_signed) {
  std::string text;
  for (const std::int64_t v : values)
    text += (is_signed ? std::to_string(v) : std::to_string(static_cast<std::uint64_t>(v))) + " ";
  return text;
}

std::string nrrd(bool is_signed, const std::string& more) {
  return std::string("NRRD0004\ntype: ") + (is_signed ? "int64" : "unsigned long long") +
         "\ndimension: 3\nsizes: 3 2 2\n" + more + "\n\n";
}

std::string meta_image(bool is_signed, const std::string& more) {
  return "NDims = 3\nDimSize = 3 2 2\nElementType = " +
         std::string(is_signed ? "MET_LONG_LONG" : "MET_ULONG_LONG") + "\n" + more +
         "ElementDataFile = LOCAL\n";
}

template <class T>
void put(std::string& bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

std::string nifti(bool is_signed) {
  std::string header(352, '\0');
  put<std::int32_t>(header, 0, 348);
  const std::int16_t dims[] = {3, 3, 2, 2};
  for (std::size_t i = 0; i < 4; ++i) put(header, 40 + 2 * i, dims[i]);
  put<std::int16_t>(header, 70, is_signed ? 1024 : 1280);
  put<float>(header, 108, 352);
  return header.replace(344, 4, std::string("n+1\0", 4));
}

std::string vti(bool is_signed, const std::string& array) {
  return std::string(
             "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"0.1\" "
             "byte_order=\"LittleEndian\"><ImageData WholeExtent=\"0 2 0 1 0 1\" "
             "Origin=\"0 0 0\" Spacing=\"1 1 1\"><Piece Extent=\"0 2 0 1 0 1\"><PointData>"
             "<DataArray Name=\"a\" type=\"") +
         (is_signed ? "Int64" : "UInt64") + "\" " + array;
}
constexpr const char* kVtiEnd = "</DataArray></PointData></Piece></ImageData></VTKFile>";

std::string legacy_vtk(bool is_signed, const std::string& encoding) {
  return "# vtk DataFile Version 3.0\nt\n" + encoding +
         "\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 2 2\nSPACING 1 1 1\nORIGIN 0 0 0\n"
         "POINT_DATA 12\nSCALARS a " +
         (is_signed ? "vtktypeint64" : "vtktypeuint64") + " 1\nLOOKUP_TABLE default\n";
}

/// Makes a file of values and returns its path.
struct Format {
  const char* name;
  std::function<std::string(const TempDir&, const Values&, bool is_signed)> write;
};

#ifdef ISOBRICK_WITH_TIFF
std::string write_tiff(const TempDir& dir, const Values& values, bool is_signed) {
  TIFF* file = TIFFOpen((dir / "v.tif").c_str(), "w");
  for (std::size_t z = 0; z < 2; ++z) {
    TIFFSetField(file, TIFFTAG_IMAGEWIDTH, 3);
    TIFFSetField(file, TIFFTAG_IMAGELENGTH, 2);
    TIFFSetField(file, TIFFTAG_BITSPERSAMPLE, 64);
    TIFFSetField(file, TIFFTAG_SAMPLESPERPIXEL, 1);
    TIFFSetField(file, TIFFTAG_SAMPLEFORMAT, is_signed ? SAMPLEFORMAT_INT : SAMPLEFORMAT_UINT);
    TIFFSetField(file, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    TIFFSetField(file, TIFFTAG_ROWSPERSTRIP, 2);
    std::string plane = stored_bytes(values).substr(z * 48, 48);
    TIFFWriteEncodedStrip(file, 0, plane.data(), 48);
    TIFFWriteDirectory(file);
  }
  TIFFClose(file);
  return dir / "v.tif";
}
#endif

#ifdef ISOBRICK_WITH_HDF5
/// `chunks`: decoded by us where plain, by the library where it has a filter of its own.
std::string write_hdf5(const TempDir& dir, const Values& values, bool is_signed, bool chunks,
                       bool scale_offset) {
  const hid_t file = H5Fcreate((dir / "v.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hsize_t sizes[3] = {2, 2, 3}, chunk[3] = {1, 2, 2};
  const hid_t space = H5Screate_simple(3, sizes, nullptr), how = H5Pcreate(H5P_DATASET_CREATE);
  if (chunks) H5Pset_chunk(how, 3, chunk);
  if (scale_offset) H5Pset_scaleoffset(how, H5Z_SO_INT, H5Z_SO_INT_MINBITS_DEFAULT);
  const hid_t data = H5Dcreate2(file, "v", is_signed ? H5T_STD_I64BE : H5T_STD_U64LE, space,
                                H5P_DEFAULT, how, H5P_DEFAULT);
  EXPECT_GE(H5Dwrite(data, is_signed ? H5T_NATIVE_INT64 : H5T_NATIVE_UINT64, H5S_ALL, H5S_ALL,
                     H5P_DEFAULT, values.data()),
            0);
  H5Dclose(data);
  H5Pclose(how);
  H5Sclose(space);
  H5Fclose(file);
  return dir / "v.h5";
}
#endif

std::vector<Format> formats() {
  using D = const TempDir&;
  using V = const Values&;
  std::vector<Format> all{
      {"nrrd raw",
       [](D d, V v, bool s) {
         return d.write("v.nrrd", nrrd(s, "encoding: raw\nendian: little") + stored_bytes(v));
       }},
      {"nrrd gzip, big",
       [](D d, V v, bool s) {
         return d.write("v.nrrd",
                        nrrd(s, "encoding: gzip\nendian: big") + gzip(stored_bytes(v, true)));
       }},
      {"nrrd text",
       [](D d, V v, bool s) {
         return d.write("v.nrrd", nrrd(s, "encoding: text") + as_text(v, s));
       }},
      {"mha",
       [](D d, V v, bool s) { return d.write("v.mha", meta_image(s, "") + stored_bytes(v)); }},
      {"nifti", [](D d, V v, bool s) { return d.write("v.nii", nifti(s) + stored_bytes(v)); }},
      {"nifti gzip",
       [](D d, V v, bool s) { return d.write("v.nii", gzip(nifti(s) + stored_bytes(v))); }},
      {"vtk",
       [](D d, V v, bool s) {
         return d.write("v.vtk", legacy_vtk(s, "BINARY") + stored_bytes(v, true));
       }},
      {"vtk text",
       [](D d, V v, bool s) { return d.write("v.vtk", legacy_vtk(s, "ASCII") + as_text(v, s)); }}};
#ifdef ISOBRICK_WITH_EXPAT
  all.push_back({"vti text", [](D d, V v, bool s) {
                   return d.write("v.vti", vti(s, "format=\"ascii\">") + as_text(v, s) + kVtiEnd);
                 }});
  all.push_back({"vti base64", [](D d, V v, bool s) {
                   const std::string bytes = stored_bytes(v);
                   return d.write("v.vti", vti(s, "format=\"binary\">") +
                                               base64(std::string("\x60\0\0\0", 4) + bytes) +
                                               kVtiEnd);
                 }});
#endif
#ifdef ISOBRICK_WITH_TIFF
  all.push_back({"tiff", write_tiff});
#endif
#ifdef ISOBRICK_WITH_HDF5
  for (const auto& [chunks, filter] : {std::pair(false, false), {true, false}, {true, true}})
    all.push_back(
        {filter   ? "hdf5 filter"
         : chunks ? "hdf5 chunks"
                  : "hdf5",
         [c = chunks, f = filter](D d, V v, bool s) { return write_hdf5(d, v, s, c, f); }});
#endif
  return all;
}

/// The values; u64 as the same bits.
std::vector<std::int64_t> read_integers(VolumeSource& source, Box3 box, bool is_signed) {
  EXPECT_EQ(source.info().type, is_signed ? ScalarType::i64 : ScalarType::u64);
  const std::string bytes = read_box(source, box);
  std::vector<std::int64_t> values(bytes.size() / 8);
  std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

std::string refusal(const std::string& path, std::string_view part) {
  const auto source = open_source(path, {});
  try {
    read_box(*source, kAll);
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    return error.what();
  }
  ADD_FAILURE() << path << ": accepted " << part;
  return {};
}

TEST(WideTypesOfFiles, StayWhatTheyAre) {
  for (const Format& format : formats())
    for (const bool is_signed : {false, true}) {
      SCOPED_TRACE(format.name);
      const TempDir dir;
      Values values = kPlain;
      values[4] = std::numeric_limits<std::int64_t>::max();
      values[6] = kLargest + 1;
      values[10] = is_signed ? std::numeric_limits<std::int64_t>::min() : -1;  // the largest u64
      const auto source = open_source(format.write(dir, values, is_signed), {});
      ASSERT_EQ(source->info().extent, kSize);
      EXPECT_EQ(read_integers(*source, kAll, is_signed),
                std::vector<std::int64_t>(values.begin(), values.end()));
      if (!source->random_access()) continue;
      EXPECT_EQ(read_integers(*source, {{1, 1, 0}, {3, 2, 2}}, is_signed),
                (std::vector<std::int64_t>{values[4], values[5], values[10], 11}));
    }
}

TEST(WideTypesOfFiles, ValuesThatAreMissingNeedADouble) {
  const TempDir dir;
  VolumeRequest request;
  request.nodata = 0;
  const auto open = [&](const Values& values) {
    return open_source(
        dir.write("v.nrrd", nrrd(true, "encoding: raw\nendian: little") + stored_bytes(values)),
        request);
  };
  const auto source = open(kPlain);
  ASSERT_EQ(source->info().type, ScalarType::f64);
  const std::string bytes = read_box(*source, kAll);
  std::array<double, 12> read;
  std::memcpy(read.data(), bytes.data(), bytes.size());
  EXPECT_NE(read[0], read[0]);
  EXPECT_EQ(read[9], 0x1p53);
  Values values = kPlain;
  values[10] = kLargest + 1;
  try {
    read_box(*open(values), kAll);
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("9007199254740993"), std::string::npos);
  }
}

TEST(WideTypesOfFiles, FillValuesOfNrrdAreExact) {
  const TempDir dir;
  const auto fill_of = [&](bool is_signed, const std::string& fill) {
    const std::string path = dir.write(
        "v.nrrd",
        nrrd(is_signed, "isobrick fill value:=" + fill + "\nencoding: raw\nendian: little") +
            stored_bytes(kPlain));
    return open_source(path, {})->info().fill_value.text();
  };
  EXPECT_EQ(fill_of(false, "18446744073709551615"), "18446744073709551615");
  EXPECT_EQ(fill_of(true, "-9223372036854775808"), "-9223372036854775808");
  for (const auto& [is_signed, fill] : {std::pair(false, "-1"),
                                        {false, "18446744073709551616"},
                                        {true, "9223372036854775808"},
                                        {true, "0.5"}})
    EXPECT_THROW(fill_of(is_signed, fill), UsageError) << fill;
}

TEST(WideTypesOfFiles, TextsBeyondTheType) {
  const TempDir dir;
  const auto text = [&](bool is_signed, const std::string& word) {
    return dir.write("v.nrrd",
                     nrrd(is_signed, "encoding: text") + "0 1 2 3 4 5 6 7 8 9 10 " + word);
  };
  refusal(text(true, "9223372036854775808"), "number");
  refusal(text(false, "18446744073709551616"), "number");
  refusal(text(false, "-1"), "number");
  refusal(text(true, "1e300"), "number");
  refusal(text(true, "9007199254740993.0"), "number");
  refusal(text(true, "0.5"), "number");
  const auto source = open_source(text(true, "-3.0"), {});
  EXPECT_EQ(read_integers(*source, kAll, true).back(), -3);
}

TEST(WideTypesOfFiles, ATypeThatIsRequestedIsTaken) {
  const TempDir dir;
  dir.write("v.nhdr", nrrd(true, "encoding: raw\nendian: little\ndata file: v.raw"));
  const std::string path = dir.write("v.raw", stored_bytes(kPlain));
  EXPECT_EQ(read_integers(*open_source(path, {}), kAll, true)[3], 300);
  VolumeRequest request;
  request.type = ScalarType::f64;
  const auto source = open_source(path, request);
  EXPECT_EQ(read_box(*source, kAll), stored_bytes(kPlain));
}

TEST(WideTypesOfFiles, NiftiScales) {
  const TempDir dir;
  std::string header = nifti(true);
  put<float>(header, 112, 0.5F);
  put<float>(header, 116, -1);
  const auto source = open_source(dir.write("v.nii", header + stored_bytes(kPlain)), {});
  ASSERT_EQ(source->info().type, ScalarType::f64);
  const std::string bytes = read_box(*source, kAll);
  double value = 0;
  std::memcpy(&value, bytes.data() + 24, sizeof value);
  EXPECT_EQ(value, 149);
}

}  // namespace
}  // namespace isobrick

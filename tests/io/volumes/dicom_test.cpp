#include <gtest/gtest.h>

#include <dcmtk/config/osconfig.h>
// Must come first.
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpls/djencode.h>

#include <cstring>
#include <filesystem>
#include <functional>

#include <isobrick/open_source.h>
#include "damaged_files.h"

namespace isobrick::inline v0 {
namespace {

constexpr Int3 kExtent{19, 17, 5};
constexpr Box3 kWhole{{0, 0, 0}, kExtent};

class Dicom : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    DJEncoderRegistration::registerCodecs();
    DJLSEncoderRegistration::registerCodecs();
    DcmRLEEncoderRegistration::registerCodecs();
  }

  /// Planes [z0, z1) of samples of u16 as one file, with what `more` adds.
  std::string write(const std::string& name, Index z0, Index z1,
                    E_TransferSyntax syntax = EXS_LittleEndianExplicit,
                    const std::function<void(DcmDataset&)>& more = nullptr) const {
    DcmFileFormat file;
    DcmDataset& data = *file.getDataset();
    data.putAndInsertString(DCM_SOPClassUID, UID_CTImageStorage);
    data.putAndInsertString(DCM_SOPInstanceUID, ("1.2.3." + std::to_string(z0 + 1)).c_str());
    data.putAndInsertString(DCM_SeriesInstanceUID, "1.2.3");
    data.putAndInsertUint16(DCM_Rows, static_cast<Uint16>(kExtent.y));
    data.putAndInsertUint16(DCM_Columns, static_cast<Uint16>(kExtent.x));
    data.putAndInsertString(DCM_NumberOfFrames, std::to_string(z1 - z0).c_str());
    data.putAndInsertUint16(DCM_SamplesPerPixel, 1);
    data.putAndInsertString(DCM_PhotometricInterpretation, "MONOCHROME2");
    data.putAndInsertUint16(DCM_BitsAllocated, 16);
    data.putAndInsertUint16(DCM_BitsStored, 16);
    data.putAndInsertUint16(DCM_HighBit, 15);
    data.putAndInsertUint16(DCM_PixelRepresentation, 0);
    data.putAndInsertString(DCM_PixelSpacing, "2\\0.5");
    data.putAndInsertString(DCM_SliceThickness, "4");
    data.putAndInsertString(DCM_ImageOrientationPatient, "0\\1\\0\\-1\\0\\0");
    data.putAndInsertString(DCM_ImagePositionPatient,
                            ("10\\20\\" + std::to_string(3 * z0)).c_str());
    if (more) more(data);
    const Box3 box{{0, 0, z0}, {kExtent.x, kExtent.y, z1}};
    const std::string samples = sample_bytes(ScalarType::u16, box, kExtent);
    std::vector<Uint16> words(samples.size() / 2);
    std::memcpy(words.data(), samples.data(), samples.size());
    data.putAndInsertUint16Array(DCM_PixelData, words.data(), words.size());
    EXPECT_TRUE(data.chooseRepresentation(syntax, nullptr).good());
    EXPECT_TRUE(file.saveFile((dir / name).c_str(), syntax).good());
    return dir / name;
  }

  TempDir dir;
};

TEST_F(Dicom, PlainAndCompressed) {
  for (const E_TransferSyntax syntax :
       {EXS_LittleEndianImplicit, EXS_LittleEndianExplicit, EXS_BigEndianExplicit,
        EXS_JPEGProcess14SV1, EXS_JPEGLSLossless, EXS_RLELossless}) {
    const auto frames = open_source(write("frames", 0, kExtent.z, syntax), {});
    EXPECT_TRUE(frames->random_access() && frames->parallel());
    EXPECT_EQ(frames->info().extent, kExtent);
    EXPECT_EQ(frames->info().transform.spacing, (Vec3d{0.5, 2, 4}));
    EXPECT_EQ(read_box(*frames, kWhole), sample_bytes(ScalarType::u16, kWhole, kExtent)) << syntax;
    std::filesystem::remove(dir / "frames");

    const char* names[] = {"e", "b", "c.dcm", "a", "d"};
    for (Index z = 0; z < kExtent.z; ++z) write(names[z], z, z + 1, syntax);
    const auto series = open_source(dir / ".", {});
    EXPECT_EQ(series->info().transform.spacing, (Vec3d{0.5, 2, 3}));
    EXPECT_EQ(series->info().transform.apply({1, 1, 1}), (Vec3d{8, 20.5, 3}));
    EXPECT_EQ(series->info().type, ScalarType::u16);
    EXPECT_EQ(read_box(*series, kWhole), sample_bytes(ScalarType::u16, kWhole, kExtent));
    const Box3 inner{{3, 2, 1}, {17, 16, 4}};
    EXPECT_EQ(read_box(*series, inner), sample_bytes(ScalarType::u16, inner, kExtent));
  }
}

/// sample_bytes() of u16, each v → v · slope + intercept as T.
template <class T>
std::string scaled_bytes(double slope, double intercept) {
  const std::string stored = sample_bytes(ScalarType::u16, kWhole, kExtent);
  std::string bytes;
  for (std::size_t i = 0; i < stored.size(); i += 2) {
    std::uint16_t v;
    std::memcpy(&v, stored.data() + i, sizeof v);
    const T real = static_cast<T>(v * slope + intercept);
    bytes.append(reinterpret_cast<const char*>(&real), sizeof real);
  }
  return bytes;
}

TEST_F(Dicom, WholeScalesLeaveIntegers) {
  const auto with = [&](const char* slope, const char* intercept, Uint16 bits) {
    return open_source(write("s", 0, kExtent.z, EXS_LittleEndianExplicit,
                             [&](DcmDataset& data) {
                               data.putAndInsertString(DCM_RescaleSlope, slope);
                               data.putAndInsertString(DCM_RescaleIntercept, intercept);
                               data.putAndInsertUint16(DCM_BitsStored, bits);
                               data.putAndInsertUint16(DCM_HighBit, Uint16(bits - 1));
                             }),
                       {});
  };
  const auto hounsfield = with("1", "-1024", 16);
  EXPECT_EQ(hounsfield->info().type, ScalarType::i32) << "-1024 to 64511";
  EXPECT_EQ(read_box(*hounsfield, kWhole), scaled_bytes<std::int32_t>(1, -1024));
  EXPECT_EQ(with("1.0", "-1024.0", 15)->info().type, ScalarType::i16);
  EXPECT_EQ(with("1", "0", 12)->info().type, ScalarType::u16);
  EXPECT_EQ(with("1", "100", 12)->info().type, ScalarType::u16);
  EXPECT_EQ(with("1e6", "0", 16)->info().type, ScalarType::f32) << "too large for 32 bits";
  const auto fractions = with("0.5", "-1024", 16);
  EXPECT_EQ(fractions->info().type, ScalarType::f32);
  EXPECT_EQ(read_box(*fractions, kWhole), scaled_bytes<float>(0.5, -1024));
}

TEST_F(Dicom, ADoseHasItsOffsetsAndItsScaling) {
  const auto dose = [&](const char* offsets) {
    return write("dose", 0, kExtent.z, EXS_LittleEndianExplicit, [&](DcmDataset& data) {
      data.putAndInsertString(DCM_SOPClassUID, UID_RTDoseStorage);
      data.putAndInsertString(DCM_GridFrameOffsetVector, offsets);
      data.putAndInsertString(DCM_DoseGridScaling, "0.25");
    });
  };
  const auto up = open_source(dose("0\\2.5\\5\\7.5\\10"), {});
  EXPECT_EQ(up->info().transform.spacing, (Vec3d{0.5, 2, 2.5}));
  EXPECT_EQ(up->info().transform.apply({0, 0, 2}), (Vec3d{10, 20, 5}));
  EXPECT_EQ(up->info().type, ScalarType::f32);
  EXPECT_EQ(read_box(*up, kWhole), scaled_bytes<float>(0.25, 0));
  const auto down = open_source(dose("100\\97\\94\\91\\88"), {});
  EXPECT_EQ(down->info().transform.apply({0, 0, 2}), (Vec3d{10, 20, -6}));
  EXPECT_TRUE(contains(message_of<UsageError>([&] { open_source(dose("0\\2\\4\\7\\9"), {}); }),
                       "frame 4 lies 3 mm behind"));
  const std::string few = message_of<UsageError>([&] { open_source(dose("0\\2\\4"), {}); });
  EXPECT_TRUE(contains(few, "3 numbers for 5 frames")) << few;
}

TEST_F(Dicom, FramesSayHowFarApartTheyLieOrTheCallerDoes) {
  const auto refused = [&](const std::string& file) {
    const std::string text = message_of<UsageError>([&] { open_source(file, {}); });
    EXPECT_TRUE(contains(text, "does not state how far apart its 5 frames lie")) << text;
    EXPECT_TRUE(contains(text, "--spacing")) << text;
    VolumeRequest request;
    request.spacing = Vec3d{1, 2, 3};
    EXPECT_EQ(open_source(file, request)->info().transform.spacing, (Vec3d{1, 2, 3}));
  };
  const auto bare = [](DcmDataset& data) { delete data.remove(DCM_SliceThickness); };
  refused(write("plain", 0, kExtent.z, EXS_LittleEndianExplicit, bare));
  refused(write("dose", 0, kExtent.z, EXS_LittleEndianExplicit, [&](DcmDataset& data) {
    bare(data);
    data.putAndInsertString(DCM_DoseGridScaling, "0.25");
  }));
  // The thickness of a dose is not the distance of its frames.
  refused(write("thick", 0, kExtent.z, EXS_LittleEndianExplicit,
                [](DcmDataset& data) { data.putAndInsertString(DCM_Modality, "RTDOSE"); }));
  const auto between = open_source(write("between", 0, kExtent.z, EXS_LittleEndianExplicit,
                                         [&](DcmDataset& data) {
                                           bare(data);
                                           data.putAndInsertString(DCM_SpacingBetweenSlices, "7");
                                         }),
                                   {});
  EXPECT_EQ(between->info().transform.spacing.z, 7);
  EXPECT_NO_THROW(open_source(write("one", 0, 1, EXS_LittleEndianExplicit, bare), {}));
}

TEST_F(Dicom, OfSlicesWithoutPositionsTheNumbersShowWhatIsMissing) {
  const auto number = [&](const char* name, Index z, const char* instance) {
    write(name, z, z + 1, EXS_LittleEndianExplicit, [&](DcmDataset& data) {
      delete data.remove(DCM_ImagePositionPatient);
      data.putAndInsertString(DCM_InstanceNumber, instance);
    });
  };
  number("s0", 0, "1"), number("s1", 1, "2"), number("s2", 2, "3"), number("s3", 3, "5"),
      number("s4", 4, "6");
  const std::string text = message_of<UsageError>([&] { open_source(dir / ".", {}); });
  EXPECT_TRUE(contains(text, "s2' and '")) << text;
  EXPECT_TRUE(contains(text, "s3', whose InstanceNumbers are 3 and 5")) << text;
  VolumeRequest request;
  request.spacing = Vec3d{1, 2, 3};
  EXPECT_EQ(open_source(dir / ".", request)->info().extent, kExtent);
  number("s3", 3, "4"), number("s4", 4, "5");
  EXPECT_EQ(open_source(dir / ".", {})->info().extent, kExtent);
}

TEST_F(Dicom, AMissingSliceIsNamed) {
  const char* names[] = {"s0", "s1", "s2", "s3", "s4", "s5", "s6"};
  for (const Index z : {0, 1, 2, 4}) write(names[z], z, z + 1);
  const std::string text = message_of<UsageError>([&] { open_source(dir / ".", {}); });
  EXPECT_TRUE(contains(text, "a slice is missing between")) << text;
  EXPECT_TRUE(contains(text, "s2' and '")) << text;
  EXPECT_TRUE(contains(text, "s4', which are 6 mm apart: elsewhere the step is 3 mm")) << text;
  std::filesystem::remove(dir / "s1");
  for (const Index z : {5, 6}) write(names[z], z, z + 1);
  const std::string first = message_of<UsageError>([&] { open_source(dir / ".", {}); });
  EXPECT_TRUE(contains(first, "s0' and '")) << first;
}

TEST_F(Dicom, DamagedFiles) {
  write("v", 0, 2);
  const std::string bytes = dir.read("v");
  std::filesystem::remove(dir / "v");
  expect_damage_is_no_crash(dir, "d.dcm", bytes, 11);
}

TEST_F(Dicom, Mutations) {
  write("v", 0, 2);
  const std::string bytes = dir.read("v");
  std::filesystem::remove(dir / "v");
  expect_mutations_are_no_crash(dir, "m.dcm", bytes);
}

TEST_F(Dicom, NothingButOtherFiles) {
  dir.write("notes.txt", "nothing");
  EXPECT_TRUE(contains(message_of([&] { open_source(dir / ".", {}); }), "without TIFF or DICOM"));
}

}  // namespace
}  // namespace isobrick

#include <gtest/gtest.h>

#include <dcmtk/config/osconfig.h>
// Must come first.
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpls/djencode.h>

#include <filesystem>

#include "damaged_files.h"
#include "isobrick/volumes/open_source.h"

namespace isobrick {
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

  /// Planes [z0, z1) of samples of u16 as one file.
  std::string write(const std::string& name, Index z0, Index z1,
                    E_TransferSyntax syntax = EXS_LittleEndianExplicit) const {
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

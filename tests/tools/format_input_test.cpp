#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "tests/tools/program.h"

// Volumes whose headers lie: one line reports it, at once, whatever they promise.
namespace isobrick::test {
namespace {

using FormatInput = ProgramTest;

/// A deflate stream of `blocks` times 258 zeros or so, wrapped as gzip without a
/// checksum that could ever be reached.
std::string endless_zeros(std::size_t bytes) {
  std::string gzip("\x1f\x8b\x08\0\0\0\0\0\0\x03", 10);
  // A block with fixed codes: a literal 0, then copies of it without end.
  gzip += "\x63";
  gzip.append(bytes, '\0');
  return gzip;
}

std::string nifti(std::int16_t nx, std::int16_t ny, std::int16_t nz) {
  std::string header(352, '\0');
  const auto put = [&](std::size_t at, std::int16_t value) {
    header[at] = static_cast<char>(value & 0xff);
    header[at + 1] = static_cast<char>(value >> 8);
  };
  put(0, 348);
  put(40, 3);
  put(42, nx);
  put(44, ny);
  put(46, nz);
  put(70, 2);
  header.replace(344, 3, "n+1");
  return header;
}

struct Case {
  std::string name, bytes;
  std::vector<std::string> parts;
};

TEST_F(FormatInput, HostileHeadersAreRefusedAtOnce) {
  const std::string nrrd = "NRRD0004\ntype: uchar\ndimension: 3\n";
  const std::string huge = "9223372036854775807";
  const std::string mha = "NDims = 3\nElementType = MET_UCHAR\n";
  const std::string vtk = "# vtk DataFile Version 3.0\nt\nBINARY\nDATASET STRUCTURED_POINTS\n";
  const std::vector<Case> cases{
      {"a.nrrd", nrrd + "sizes: " + huge + " 2 2\nencoding: raw\n\n", {"too large"}},
      {"b.nrrd", nrrd + "sizes: -4 2 2\nencoding: raw\n\n", {"not positive"}},
      {"c.nrrd", nrrd + "sizes: 4 4 4\nencoding: raw\n\n12345", {"126", "67"}},
      {"d.nrrd",
       nrrd + "sizes: 60000 60000 60000\nencoding: gzip\n\n" + endless_zeros(4000),
       {"at most"}},
      {"e.nrrd", nrrd + "sizes: 400 400 4\nencoding: gzip\n\n" + endless_zeros(4000), {"e.nrrd"}},
      {"f.nrrd", nrrd + "sizes: 4 4 4\nencoding: raw\ndata file: ../../etc/passwd\n", {"outside"}},
      {"g.nrrd", nrrd + "sizes: 4 4 4\nencoding: raw\ndata file: /etc/passwd\n", {"outside"}},
      {"h.nhdr", nrrd + "sizes: 4 4 4\nencoding: raw\ndata file: v%d 0 " + huge + "\n", {"sense"}},
      {"i.mha",
       mha + "DimSize = " + huge + " " + huge + " 2\nElementDataFile = LOCAL\n",
       {"too large"}},
      {"j.mha", mha + "DimSize = 0 4 4\nElementDataFile = LOCAL\n", {"not positive"}},
      {"k.mhd", mha + "DimSize = 4 4 4\nElementDataFile = ../x.raw\n", {"outside"}},
      {"l.mhd", mha + "DimSize = 4 4 4\nElementDataFile = LIST\na\n../../b\n", {"outside"}},
      {"m.mha",
       mha + "DimSize = 4 4 4\nCompressedData = True\nElementDataFile = LOCAL\nzlib?",
       {"m.mha"}},
      {"n.nii", nifti(32767, 32767, 32767), {"promises"}},
      {"o.nii", nifti(-1, 4, 4), {"not positive"}},
      {"p.vtk",
       vtk + "DIMENSIONS " + huge + " 4 4\nPOINT_DATA 64\nSCALARS s float\n",
       {"too large"}},
      {"q.vtk", vtk + "DIMENSIONS 4 4 4\nPOINT_DATA 65\nSCALARS s float\n", {"65"}},
      {"r.vtk", vtk + "DIMENSIONS 4 4 4\nPOINT_DATA 64\nSCALARS s float\n", {"promises"}},
      {"s.vti", "<VTKFile type=\"ImageData\"><ImageData WholeExtent=\"0 1 0 1 0 1\">", {"s.vti"}},
      {"t.tif", std::string("II*\0\xff\xff\xff\x7f", 8), {"t.tif"}},
      {"u.h5", "\x89HDF\r\n\x1a\n", {"u.h5"}},
      {"v.dcm", std::string(128, '\0') + "DICM", {"v.dcm"}},
      {"w", nrrd + "sizes: 2 2 2\nencoding: raw\n\n1234567", {"7"}},
  };
  for (const Case& one : cases) {
    SCOPED_TRACE(one.name);
    write_file(path(one.name), one.bytes);
    const auto start = std::chrono::steady_clock::now();
    const Outcome outcome = run({"convert", path(one.name), path("out.zarr"), "--memory", "64M"});
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    EXPECT_TRUE(outcome.exit_code == 1 || outcome.exit_code == 2) << outcome.exit_code;
    expect_refused(outcome, outcome.exit_code, {one.name});
    for (const std::string& part : one.parts) expect_refused(outcome, outcome.exit_code, {part});
    EXPECT_LT(seconds.count(), 5);  // far below a second but where the machine is busy
    EXPECT_FALSE(std::filesystem::exists(path("out.zarr")));
    std::filesystem::remove(path(one.name));
    std::filesystem::remove_all(path("out.zarr.partial"));  // of what is found out on the way
  }
}

TEST_F(FormatInput, OptionsThatMakeNoSenseForAFormat) {
  write_file(path("v.nii"), nifti(4, 4, 4) + noise(64));
  const Arguments convert{"convert", path("v.nii"), path("out.zarr")};
  const std::vector<std::pair<Arguments, std::string>> options{
      {{"--dims", "4,4,4"}, "--dims"},   {{"--type", "u8"}, "--type"},
      {{"--endian", "big"}, "--endian"}, {{"--offset", "352"}, "--offset"},
      {{"--channel", "1"}, "1 channel"}, {{"--time", "7"}, "1 time"},
      {{"--time", "-1"}, "-1"},          {{"--channel", "x"}, "x"},
  };
  for (const auto& [option, part] : options) {
    Arguments words = convert;
    words.insert(words.end(), option.begin(), option.end());
    expect_refused(run(words), 2, {part});
  }
  EXPECT_EQ(run(convert).exit_code, 0);
  expect_refused(run({"convert", path("v.nii") + ":/v", path("other.zarr")}), 2, {":/v"});
}

TEST_F(FormatInput, WhatIsIgnoredOfAFileIsNoted) {
  write_file(
      path("v.nrrd"),
      "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n\n" + noise(64) + "\n");
  const std::string note = "v.nrrd': 1 byte after the samples is ignored";
  const Outcome outcome = run({"convert", path("v.nrrd"), path("a.zarr")});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.err.find(note), std::string::npos) << outcome.err;
  const nlohmann::json report = run_json({"convert", path("v.nrrd"), path("b.zarr")});
  ASSERT_EQ(report["notes"].size(), 1u);
  EXPECT_NE(report["notes"][0].get<std::string>().find(note), std::string::npos);
  write_file(path("w.nii"), nifti(4, 4, 4) + noise(64));
  EXPECT_TRUE(run_json({"convert", path("w.nii"), path("c.zarr")})["notes"].empty());
}

}  // namespace
}  // namespace isobrick::test

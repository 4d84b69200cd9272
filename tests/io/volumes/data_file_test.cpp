#include <cstring>
#include <utility>
#include <vector>

#include "damaged_files.h"
#include "tests/io/bytes/packed.h"
#include "text_volume.h"

// Files of samples that are missing, too short or too long for the header that describes them.
namespace isobrick::inline v0 {
namespace {

using DataFile = TextVolume;

TEST_F(DataFile, AWrongSizeNamesBothHalvesAndTypesThatFit) {
  const auto message_for = [&](const char* name) {
    return message_of<UsageError>([&] { open_source(dir / name, {}); });
  };
  const std::string header = nrrd("encoding: raw\nendian: little\n");
  dir.write("attached.nrrd", header + "\n" + whole(ScalarType::i16).substr(1));
  const std::string attached = message_for("attached.nrrd");
  EXPECT_TRUE(contains(attached, "make ")) << attached;
  EXPECT_FALSE(contains(attached, "--offset")) << attached;
  dir.write("v.raw", whole(ScalarType::i16).substr(1));
  dir.write("v.nhdr", header + "data file: v.raw\n");
  const std::string apart = message_for("v.nhdr");
  EXPECT_TRUE(contains(apart, "v.raw' has 279 bytes")) << apart;
  EXPECT_TRUE(contains(apart, "v.nhdr' has them")) << apart;
  dir.write("v.raw", whole(ScalarType::i32));
  EXPECT_TRUE(contains(message_for("v.nhdr"), "would fit the type u32 or i32 or f32"));
}

TEST_F(DataFile, MissingAndShortDataNameTheHeaderToo) {
  const auto message_for = [&](const char* name) {
    return message_of<Error>([&] { open_and_read(name); });
  };
  const std::string meta =
      "NDims = 3\nDimSize = 7 5 4\nElementType = MET_SHORT\nElementDataFile = gone.raw\n";
  dir.write("v.nhdr", nrrd("encoding: raw\nendian: little\ndata file: gone.raw\n"));
  dir.write("v.mhd", meta);
  dir.write("z.nhdr", nrrd("encoding: gzip\nendian: little\ndata file: v.gz\n"));
  for (const char* name : {"v.nhdr", "v.mhd", "z.nhdr"}) {
    const std::string message = message_for(name);
    EXPECT_TRUE(contains(message, "No such file")) << message;
    EXPECT_TRUE(contains(message, "the header '" + (dir / name) + "' needs it")) << message;
  }
  dir.write("v.gz", gzip(whole(ScalarType::i16).substr(1)));
  EXPECT_TRUE(contains(message_for("z.nhdr"), "were expected by '" + (dir / "z.nhdr")));
}

TEST_F(DataFile, BytesAfterTheSamplesAreIgnoredWithANote) {
  const std::string samples = whole(ScalarType::i16);
  const std::string head = nrrd("encoding: raw\nendian: little\n");
  const std::string packed_head = nrrd("encoding: gzip\nendian: little\n\n");
  const std::string meta =
      "NDims = 3\nDimSize = 7 5 4\nElementType = MET_SHORT\nElementDataFile = ";
  std::string text;
  for (std::size_t i = 0; i < samples.size(); i += 2) {
    std::int16_t sample;
    std::memcpy(&sample, &samples[i], 2);
    text += std::to_string(sample) + " ";
  }
  dir.write("v.raw", samples + "0123456789");
  dir.write("line.nrrd", head + "\n" + samples + "\n");
  dir.write("apart.nhdr", head + "data file: v.raw\n");
  dir.write("local.mha", meta + "LOCAL\n" + samples + "0123456789");
  dir.write("apart.mhd", meta + "v.raw\n");
  dir.write("v.nhdr", head + "data file: v.raw\n");
  dir.write("within.nrrd", packed_head + gzip(samples + "!!"));
  dir.write("behind.nrrd", packed_head + gzip(samples) + std::string(512, '\0'));
  dir.write("both.nrrd", packed_head + gzip(samples + "!!") + "tail");
  dir.write("text.nrrd", nrrd("encoding: text\n\n") + text + "1 2 3\n");
  const std::string ten = ": 10 bytes after the samples are ignored";
  const std::vector<std::pair<const char*, std::vector<std::string>>> cases{
      {"line.nrrd", {": 1 byte after the samples is ignored"}},
      {"apart.nhdr", {ten}},
      {"v.raw", {ten}},
      {"local.mha", {ten}},
      {"apart.mhd", {ten}},
      {"within.nrrd", {": 2 bytes after the samples are ignored"}},
      {"behind.nrrd", {": 512 bytes after the compressed data are ignored"}},
      {"both.nrrd",
       {": 2 bytes after the samples are ignored", ": 4 bytes after the compressed data are ign"}},
      {"text.nrrd", {": 3 numbers after the samples are ignored"}}};
  for (const auto& [name, parts] : cases) {
    const auto source = open_source(dir / name, {});
    EXPECT_EQ(read_all(*source), samples) << name;
    const std::vector<std::string> notes = source->notes();
    ASSERT_EQ(notes.size(), parts.size()) << name;
    for (std::size_t i = 0; i < parts.size(); ++i)
      EXPECT_TRUE(contains(notes[i], parts[i])) << notes[i];
  }
  dir.write("exact.nrrd", head + "\n" + samples);
  EXPECT_TRUE(open_source(dir / "exact.nrrd", {})->notes().empty());
  // A note reports that the file has more samples than the request describes.
  VolumeRequest request;
  request.extent = kExtent;
  request.type = ScalarType::i16;
  dir.write("plain.raw", samples + "0123456789");
  for (const char* raw : {"plain.raw", "v.raw"})
    EXPECT_TRUE(contains(message_of([&] { open_source(dir / raw, request); }), "--offset 10"))
        << raw;
}

}  // namespace
}  // namespace isobrick

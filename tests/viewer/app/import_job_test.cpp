#include "viewer/app/import_job.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include <isobrick/open_source.h>
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

ImportJob::State finished(const ImportJob& job) {
  for (int i = 0; i < 3000 && !job.state().finished; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return job.state();
}

std::string ramp(std::size_t n) {
  std::string samples(n, '\0');
  for (std::size_t i = 0; i < n; ++i) samples[i] = static_cast<char>(i / 999 % 256);
  return samples;
}

/// With a cache in `dir`.
OpenOptions cached(const TempDir& dir) {
  OpenOptions options;
  options.cache.folder = dir / "cache";
  return options;
}

Int3 extent_of(const OpenedVolume* volume) {
  return volume == nullptr ? Int3{} : volume->store().info().levels[0].lattice.extent;
}

TEST(ImportJob, OpensWhatItIsGivenThroughTheCache) {
  const TempDir dir;
  dir.write("ramp_40x30x20_uint8.raw", ramp(40 * 30 * 20));
  for (const bool first : {true, false}) {
    ImportJob job(dir / "ramp_40x30x20_uint8.raw", cached(dir));
    const ImportJob::State state = finished(job);
    EXPECT_TRUE(state.finished);
    EXPECT_EQ(state.failure, "");
    const auto opened = job.take();
    EXPECT_EQ(extent_of(opened.get()), (Int3{40, 30, 20}));
    EXPECT_EQ(opened->converted(), first);
    EXPECT_EQ(state.notes.size(), first ? 1u : 0u);
    EXPECT_EQ(job.take(), nullptr);
  }
}

TEST(ImportJob, WithoutACacheTheStoreGoesWithTheVolume) {
  const TempDir dir;
  dir.write("ramp_40x30x20_uint8.raw", ramp(40 * 30 * 20));
  ImportJob job(dir / "ramp_40x30x20_uint8.raw", OpenOptions{});
  EXPECT_EQ(finished(job).failure, "");
  auto opened = job.take();
  const std::filesystem::path store = opened->store().storage()->local_path();
  EXPECT_TRUE(std::filesystem::exists(store));
  opened.reset();
  EXPECT_FALSE(std::filesystem::exists(store));
}

TEST(ImportJob, HasTheRemarksOfTheReader) {
  const TempDir dir;
  dir.write("ramp.nrrd", "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 40 30 20\nencoding: raw\n\n" +
                             ramp(40 * 30 * 20 + 9));
  const ImportJob job(dir / "ramp.nrrd", cached(dir));
  const ImportJob::State state = finished(job);
  EXPECT_EQ(state.failure, "");
  ASSERT_EQ(state.notes.size(), 2u);
  EXPECT_EQ(state.notes[1], open_source(dir / "ramp.nrrd", VolumeRequest{})->notes().at(0));
  EXPECT_TRUE(contains(state.notes[1], "9 bytes")) << state.notes[1];
}

/// The first of several volumes is opened, channels or times.
TEST(ImportJob, TakesTheFirstOfSeveralVolumes) {
  const TempDir dir;
  const std::string head = "NRRD0004\ntype: uint8\ndimension: 4\nencoding: raw\n";
  const std::string samples = ramp(2 * 40 * 30 * 20);
  dir.write("time.nrrd", head + "sizes: 40 30 20 2\nkinds: space space space time\n\n" + samples);
  dir.write("channel.nrrd",
            head + "sizes: 2 40 30 20\nkinds: vector space space space\n\n" + samples);
  for (const std::string name : {"time", "channel"}) {
    ImportJob job(dir / (name + ".nrrd"), cached(dir));
    const ImportJob::State state = finished(job);
    EXPECT_EQ(state.failure, "");
    ASSERT_EQ(state.notes.size(), 2u);
    EXPECT_TRUE(contains(state.notes[1], "isobrick view --" + name + ")")) << state.notes[1];
    EXPECT_EQ(extent_of(job.take().get()), (Int3{40, 30, 20}));
  }
}

TEST(ImportJob, SaysWhatIsWrong) {
  const TempDir dir;
  dir.write("ramp_40x30x20_uint8.raw", ramp(100));
  const ImportJob job(dir / "ramp_40x30x20_uint8.raw", cached(dir));
  EXPECT_NE(finished(job).failure.find("ramp_40x30x20_uint8.raw"), std::string::npos);
}

TEST(ImportJob, GoesOnWithWhatACancelledOneHasDone) {
  const TempDir dir;
  const std::string file = "ramp_512x512x256_uint8.raw";
  dir.write(file, ramp(512 * 512 * 256));
  {
    ImportJob job(dir / file, cached(dir));
    while (job.state().done == 0 && !job.state().finished) std::this_thread::yield();
  }
  EXPECT_EQ(dir.list(), (std::vector<std::string>{"cache", file}));
  ImportJob job(dir / file, cached(dir));
  EXPECT_EQ(finished(job).failure, "");
  EXPECT_EQ(extent_of(job.take().get()), (Int3{512, 512, 256}));
}

TEST(ImportJob, SaysHowRawFilesAreNamed) {
  const TempDir dir;
  dir.write("ramp.raw", ramp(1000));
  const ImportJob job(dir / "ramp.raw", cached(dir));
  EXPECT_TRUE(contains(finished(job).failure, "256x256x128_uint8.raw"));
}

TEST(ImportJob, NamesAMeshAsOne) {
  const TempDir dir;
  dir.write("head.STL", ramp(1000));
  const ImportJob job(dir / "head.STL", cached(dir));
  const std::string failure = finished(job).failure;
  EXPECT_TRUE(contains(failure, "head.STL' is a mesh")) << failure;
  EXPECT_TRUE(contains(failure, "isobrick render ")) << failure;
  EXPECT_EQ(dir.list(), std::vector<std::string>{"head.STL"});
}

/// A folder of slices is opened as one, whatever its content.
TEST(ImportJob, TakesFolders) {
  const TempDir dir;
  std::filesystem::create_directory(dir / "slices");
  const ImportJob job(dir / "slices", cached(dir));
  EXPECT_EQ(finished(job).failure,
            message_of<Error>([&] { open_source(dir / "slices", VolumeRequest{}); }));
}

TEST(ImportJob, TakesTheFirstGridOfFloats) {
  const VdbGrid colour{.name = "colour", .type = "Tree_vec3s_5_4_3"},
      density{.name = "density[0]", .type = "Tree_float_5_4_3"},
      other{.name = "density[1]", .type = "Tree_float_5_4_3"};
  EXPECT_EQ(grid_to_show({colour, density, other}), "density[0]");
  EXPECT_EQ(grid_to_show({colour, colour}), std::nullopt);
  EXPECT_EQ(grid_to_show({density}), std::nullopt) << "nobody has to choose";
  EXPECT_EQ(grid_to_show({colour, density}), std::nullopt) << "nobody can";
  const VdbGrid labels{.name = "labels", .type = "Tree_int32_5_4_3"},
      others{.name = "others", .type = "Tree_int64_5_4_3"},
      shallow{.name = "shallow", .type = "Tree_float_4_3"};
  EXPECT_EQ(grid_to_show({shallow, labels, density}), "density[0]");
  EXPECT_EQ(grid_to_show({labels, others}), "labels");
}

}  // namespace
}  // namespace isobrick

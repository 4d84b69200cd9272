#include "viewer/app/import_job.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include <isobrick/open_source.h>
#include <isobrick/store_reader.h>
#include "io/bytes/file.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick {
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

TEST(ImportJob, ConvertsWhatItIsGiven) {
  const TempDir dir;
  dir.write("ramp_40x30x20_uint8.raw", ramp(40 * 30 * 20));
  const ImportJob job(dir / "ramp_40x30x20_uint8.raw", dir / "ramp.zarr", {});
  const ImportJob::State state = finished(job);
  EXPECT_TRUE(state.finished);
  EXPECT_EQ(state.failure, "");
  EXPECT_EQ(StoreReader(dir / "ramp.zarr").info().levels[0].lattice.extent, (Int3{40, 30, 20}));
}

TEST(ImportJob, HasTheRemarksOfTheReader) {
  const TempDir dir;
  dir.write("ramp.nrrd", "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 40 30 20\nencoding: raw\n\n" +
                             ramp(40 * 30 * 20 + 9));
  const ImportJob job(dir / "ramp.nrrd", dir / "ramp.zarr", {});
  const ImportJob::State state = finished(job);
  EXPECT_EQ(state.failure, "");
  ASSERT_EQ(state.notes.size(), 1u);
  EXPECT_EQ(state.notes, open_source(dir / "ramp.nrrd", VolumeRequest{})->notes());
  EXPECT_TRUE(contains(state.notes[0], "9 bytes")) << state.notes[0];
}

/// The first of several volumes is converted, channels or times.
TEST(ImportJob, TakesTheFirstOfSeveralVolumes) {
  const TempDir dir;
  const std::string head = "NRRD0004\ntype: uint8\ndimension: 4\nencoding: raw\n";
  const std::string samples = ramp(2 * 40 * 30 * 20);
  dir.write("time.nrrd", head + "sizes: 40 30 20 2\nkinds: space space space time\n\n" + samples);
  dir.write("channel.nrrd",
            head + "sizes: 2 40 30 20\nkinds: vector space space space\n\n" + samples);
  for (const std::string name : {"time", "channel"}) {
    const ImportJob job(dir / (name + ".nrrd"), dir / (name + ".zarr"), {});
    const ImportJob::State state = finished(job);
    EXPECT_EQ(state.failure, "");
    ASSERT_EQ(state.notes.size(), 1u);
    EXPECT_TRUE(contains(state.notes[0], "isobrick convert --" + name + ")")) << state.notes[0];
    EXPECT_EQ(StoreReader(dir / (name + ".zarr")).info().levels[0].lattice.extent,
              (Int3{40, 30, 20}));
  }
}

TEST(ImportJob, SaysWhatIsWrong) {
  const TempDir dir;
  dir.write("ramp_40x30x20_uint8.raw", ramp(100));
  const ImportJob job(dir / "ramp_40x30x20_uint8.raw", dir / "ramp.zarr", {});
  EXPECT_NE(finished(job).failure.find("ramp_40x30x20_uint8.raw"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(dir / "ramp.zarr"));
}

TEST(ImportJob, LeavesNothingWhenItIsCancelled) {
  const TempDir dir;
  dir.write("ramp_512x512x256_uint8.raw", ramp(512 * 512 * 256));
  {
    ImportJob job(dir / "ramp_512x512x256_uint8.raw", dir / "ramp.zarr", {});
    while (job.state().done == 0 && !job.state().finished) std::this_thread::yield();
  }
  EXPECT_EQ(dir.list().size(), 1u);
}

/// Another process may begin to write the same store after its name was chosen.
TEST(ImportJob, LeavesWhatAnotherConversionHas) {
  const TempDir dir;
  dir.write("ramp_40x30x20_uint8.raw", ramp(40 * 30 * 20));
  const std::string partial = dir / "ramp.zarr.partial";
  std::filesystem::create_directory(partial);
  dir.write("ramp.zarr.partial/.isobrick-layout.json", "{}");
  for (const bool held : {true, false}) {
    const UniqueFd folder(::open(partial.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    ASSERT_EQ(::flock(folder.get(), held ? LOCK_EX | LOCK_NB : LOCK_UN), 0);
    const ImportJob job(dir / "ramp_40x30x20_uint8.raw", dir / "ramp.zarr", {});
    const std::string failure = finished(job).failure;
    EXPECT_EQ(contains(failure, "another conversion is writing"), held) << failure;
    EXPECT_FALSE(failure.empty());
    EXPECT_TRUE(std::filesystem::exists(partial + "/.isobrick-layout.json"));
  }
}

TEST(ImportJob, SaysHowRawFilesAreNamed) {
  const TempDir dir;
  dir.write("ramp.raw", ramp(1000));
  const ImportJob job(dir / "ramp.raw", dir / "ramp.zarr", {});
  EXPECT_TRUE(contains(finished(job).failure, "256x256x128_uint8.raw"));
}

TEST(ImportJob, NamesAMeshAsOne) {
  const TempDir dir;
  dir.write("head.STL", ramp(1000));
  const ImportJob job(dir / "head.STL", dir / "head.zarr", {});
  const std::string failure = finished(job).failure;
  EXPECT_TRUE(contains(failure, "head.STL' is a mesh")) << failure;
  EXPECT_TRUE(contains(failure, "isobrick render ")) << failure;
  EXPECT_EQ(dir.list(), std::vector<std::string>{"head.STL"});
}

/// A folder of slices is opened as one, whatever its content.
TEST(ImportJob, TakesFolders) {
  const TempDir dir;
  std::filesystem::create_directory(dir / "slices");
  const ImportJob job(dir / "slices", dir / "slices.zarr", {});
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

TEST(StoreFor, TakesANameThatIsFree) {
  const TempDir dir;
  EXPECT_EQ(store_for(dir / "a.nrrd"), dir / "a.zarr");
  dir.write("a.zarr", "");
  EXPECT_EQ(store_for(dir / "a.nrrd"), dir / "a-2.zarr");
  std::filesystem::create_directory(dir / "a-2.zarr.partial");
  EXPECT_EQ(store_for(dir / "a.nrrd"), dir / "a-3.zarr");
  EXPECT_EQ(store_for(dir / "b.zarr.zip"), dir / "b.zarr");
}

}  // namespace
}  // namespace isobrick

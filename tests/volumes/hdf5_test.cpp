#include <gtest/gtest.h>
#include <hdf5.h>

#include <thread>

#include "damaged_files.h"
#include "isobrick/volumes/open_source.h"

namespace isobrick {
namespace {

constexpr Int3 kExtent{19, 17, 5};
constexpr Box3 kWhole{{0, 0, 0}, kExtent};

class Hdf5 : public ::testing::Test {
 protected:
  /// Writes the samples of i16 as the dataset /v, big endian, in chunks if `chunk` > 0.
  std::string write(const std::string& name, hsize_t chunk) const {
    const hid_t file = H5Fcreate((dir / name).c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    const hsize_t sizes[3] = {5, 17, 19}, chunks[3] = {chunk, chunk, chunk};
    const hid_t space = H5Screate_simple(3, sizes, nullptr), how = H5Pcreate(H5P_DATASET_CREATE);
    if (chunk > 0) {
      H5Pset_chunk(how, 3, chunks);
      H5Pset_deflate(how, 4);
    }
    const hid_t data = H5Dcreate2(file, "v", H5T_STD_I16BE, space, H5P_DEFAULT, how, H5P_DEFAULT);
    const std::string samples = sample_bytes(ScalarType::i16, kWhole, kExtent);
    EXPECT_GE(H5Dwrite(data, H5T_NATIVE_INT16, H5S_ALL, H5S_ALL, H5P_DEFAULT, samples.data()), 0);
    H5Dclose(data);
    H5Pclose(how);
    H5Sclose(space);
    H5Fclose(file);
    return dir / name;
  }

  TempDir dir;
};

TEST_F(Hdf5, AnyBoxOfPlainAndChunkedData) {
  for (const hsize_t chunk : {0, 3, 5}) {
    const auto path = write("v.data", chunk);
    for (const auto& name : {path, path + ":/v"}) {
      const auto source = open_source(name, {});
      EXPECT_TRUE(source->random_access());
      EXPECT_FALSE(source->parallel());
      EXPECT_EQ(source->info().extent, kExtent);
      EXPECT_EQ(source->info().type, ScalarType::i16);
      EXPECT_EQ(read_box(*source, kWhole), sample_bytes(ScalarType::i16, kWhole, kExtent));
      const Box3 inner{{3, 2, 1}, {17, 16, 4}};
      EXPECT_EQ(read_box(*source, inner), sample_bytes(ScalarType::i16, inner, kExtent));
      EXPECT_EQ(source->memory() > 0, chunk > 0);
    }
  }
  EXPECT_TRUE(contains(message_of<Error>([&] { open_source(dir / "v.data:/w", {}); }), "'/w'"));
}

TEST_F(Hdf5, SourcesOfSeveralThreads) {
  write("a.h5", 3);
  write("b.h5", 0);
  std::vector<std::thread> threads;
  for (const char* name : {"a.h5", "b.h5", "a.h5"})
    threads.emplace_back([&, name] {
      for (int i = 0; i < 10; ++i)
        EXPECT_EQ(read_box(*open_source(dir / name, {}), kWhole),
                  sample_bytes(ScalarType::i16, kWhole, kExtent));
    });
  for (auto& thread : threads) thread.join();
}

TEST_F(Hdf5, TruncatedFiles) {
  write("v.h5", 3);
  const std::string bytes = dir.read("v.h5");
  for (std::size_t size = 0; size < bytes.size(); size += 37)
    EXPECT_TRUE(contains(
        message_of<Error>([&] { open_source(dir.write("d.h5", bytes.substr(0, size)), {}); }),
        "d.h5"));
}

}  // namespace
}  // namespace isobrick

#include <functional>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/open_source.h>
#include "damaged_files.h"
#include "hdf5_file.h"
#include "test_samples.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

class Hdf5Lzf : public ::testing::Test {
 protected:
  TempDir dir;
};

/// h5py's filter: its own version, LibLZF's, and the bytes of a chunk.
void set_lzf(hid_t how) {
  const unsigned values[] = {4, 0x0105, 2 * 5 * 6};
  // A filter that only reads, as the module's, would keep the dataset from being made.
  if (H5Zfilter_avail(32000) > 0) H5Zunregister(32000);
  H5Pset_filter(how, 32000, H5Z_FLAG_OPTIONAL, 3, values);
}

/// One chunk of 60 bytes as LibLZF packs it: four literals, then references that
/// overlap what they write, with and without a byte for their length.
const std::string kLzfChunk{
    "\x03"
    "abcd\x20\x03\xe0\x2c\x03",
    10};
const std::string kLzfSamples = [] {
  std::string samples;
  while (samples.size() < 60) samples += "abcd";
  return samples;
}();

TEST_F(Hdf5Lzf, LzfOfH5py) {
  const std::pair<std::uint32_t, std::function<void(hid_t)>> filters[] = {
      {0, set_lzf},
      {2,  // compressed twice, which is left to the library; deflate is skipped
       [](hid_t how) {
         set_lzf(how);
         H5Pset_deflate(how, 6);
       }}};
  for (const auto& [skipped, set] : filters) {
    create(dir / "v.h5", H5T_STD_U8LE, set, [&, mask = skipped](hid_t data) {
      const hsize_t at[3] = {2, 5, 6};
      ASSERT_GE(H5Dwrite_chunk(data, H5P_DEFAULT, mask, at, kLzfChunk.size(), kLzfChunk.data()), 0);
    });
    EXPECT_EQ(read_box(*open_source(dir / "v.h5", {}), {{6, 5, 2}, {12, 10, 4}}), kLzfSamples);
  }
}

/// What LibLZF makes of bytes that do not repeat.
std::string lzf_of_literals(const std::string& bytes) {
  std::string packed;
  for (std::size_t at = 0; at < bytes.size(); at += 32) {
    const std::string part = bytes.substr(at, 32);
    packed += static_cast<char>(part.size() - 1);
    packed += part;
  }
  return packed;
}

/// h5py's scaleoffset with lzf behind it: what is packed is not the chunk's size.
TEST_F(Hdf5Lzf, LzfOfWhatAnotherFilterMadeSmallerOrLarger) {
  const auto scale = [](hid_t how) { H5Pset_scaleoffset(how, H5Z_SO_INT, 0); };
  const hsize_t at[3] = {2, 5, 6};
  for (const int range : {4, 256}) {
    std::string samples, chunk(1000, '\0');
    for (int i = 0; i < 5 * 17 * 19; ++i) samples += static_cast<char>(i * 7 % range);
    hsize_t size = 0;
    create(dir / "scaled.h5", H5T_STD_U8LE, scale, [&](hid_t data) {
      ASSERT_GE(H5Dwrite(data, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, samples.data()), 0);
      ASSERT_GE(H5Dflush(data), 0);
      std::uint32_t skipped = 0;
      ASSERT_GE(H5Dget_chunk_storage_size(data, at, &size), 0);
      ASSERT_GE(H5Dread_chunk(data, H5P_DEFAULT, at, &skipped, chunk.data()), 0);
    });
    EXPECT_EQ(size < 60, range == 4) << size;
    EXPECT_NE(size, 60U);
    const std::string packed = lzf_of_literals(chunk.substr(0, size));
    create(
        dir / "v.h5", H5T_STD_U8LE, [&](hid_t how) { scale(how), set_lzf(how); },
        [&](hid_t data) {
          ASSERT_GE(H5Dwrite_chunk(data, H5P_DEFAULT, 0, at, packed.size(), packed.data()), 0);
        });
    const Box3 box{{6, 5, 2}, {12, 10, 4}};
    EXPECT_EQ(read_box(*open_source(dir / "v.h5", {}), box),
              read_box(*open_source(dir / "scaled.h5", {}), box));
  }
}

TEST_F(Hdf5Lzf, DamagedLzfIsNamed) {
  std::vector<std::string> damaged{kLzfChunk + "\x01", kLzfChunk + std::string("\0x", 2),
                                   std::string("\x20\x03", 2) + kLzfChunk};
  for (std::size_t size = 1; size < kLzfChunk.size(); ++size)
    damaged.push_back(kLzfChunk.substr(0, size));
  for (const std::string& bytes : damaged) {
    create(dir / "v.h5", H5T_STD_U8LE, set_lzf, [&](hid_t data) {
      const hsize_t at[3] = {2, 5, 6};
      ASSERT_GE(H5Dwrite_chunk(data, H5P_DEFAULT, 0, at, bytes.size(), bytes.data()), 0);
    });
    const auto source = open_source(dir / "v.h5", {});
    const std::string message = message_of<DamageError>([&] { read_box(*source, kWhole); });
    EXPECT_TRUE(contains(message, "the chunk at [2, 5, 6]")) << message;
    EXPECT_TRUE(contains(message, "LZF")) << message;
  }
}

}  // namespace
}  // namespace isobrick

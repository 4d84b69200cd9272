#include <gtest/gtest.h>
#include <hdf5.h>

#include <array>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/open_source.h>
#include "damaged_files.h"
#include "hdf5_file.h"

namespace isobrick::inline v0 {
namespace {

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
  for (const char* name : {"w", "w/v", "v/v"})
    EXPECT_TRUE(contains(
        message_of<UsageError>([&] { open_source(dir / (std::string("v.data:/") + name), {}); }),
        "it has /v"));
}

/// Slabs, as a conversion requests them, then a box across chunks.
void expect_samples(const std::string& path, ScalarType type, int threads) {
  VolumeRequest request;
  request.threads = threads;
  const auto source = open_source(path, request);
  ASSERT_EQ(source->info().type, type);
  for (const Index planes : {1, 3, 5}) {
    Box3 box = kWhole;
    for (box.lo.z = 0; box.lo.z < kExtent.z; box.lo.z = box.hi.z) {
      box.hi.z = std::min(box.lo.z + planes, kExtent.z);
      ASSERT_EQ(read_box(*source, box), sample_bytes(type, box, kExtent)) << planes;
    }
  }
  const Box3 inner{{5, 4, 1}, {13, 16, 4}}, one{{7, 8, 2}, {8, 9, 3}};
  EXPECT_EQ(read_box(*source, inner), sample_bytes(type, inner, kExtent));
  EXPECT_EQ(read_box(*source, one), sample_bytes(type, one, kExtent));
}

TEST_F(Hdf5, FiltersOfAllKinds) {
  struct Case {
    ScalarType type;
    hid_t native, little, big;
  };
  const Case types[] = {
      {ScalarType::u8, H5T_NATIVE_UINT8, H5T_STD_U8LE, H5T_STD_U8BE},
      {ScalarType::u16, H5T_NATIVE_UINT16, H5T_STD_U16LE, H5T_STD_U16BE},
      {ScalarType::i32, H5T_NATIVE_INT32, H5T_STD_I32LE, H5T_STD_I32BE},
      {ScalarType::f32, H5T_NATIVE_FLOAT, H5T_IEEE_F32LE, H5T_IEEE_F32BE},
      {ScalarType::f64, H5T_NATIVE_DOUBLE, H5T_IEEE_F64LE, H5T_IEEE_F64BE},
  };
  const std::pair<const char*, std::function<void(hid_t)>> filters[] = {
      {"none", [](hid_t) {}},
      {"deflate", [](hid_t how) { H5Pset_deflate(how, 6); }},
      {"stored", [](hid_t how) { H5Pset_deflate(how, 0); }},
      {"shuffle", [](hid_t how) { H5Pset_shuffle(how); }},
      {"checksum", [](hid_t how) { H5Pset_fletcher32(how); }},
      {"all",
       [](hid_t how) {
         H5Pset_shuffle(how);
         H5Pset_deflate(how, 6);
         H5Pset_fletcher32(how);
       }},
      {"checksum first",
       [](hid_t how) {
         H5Pset_fletcher32(how);
         H5Pset_shuffle(how);
         H5Pset_deflate(how, 6);
       }},
      {"twice",  // is left to the library
       [](hid_t how) {
         H5Pset_deflate(how, 6);
         H5Pset_deflate(how, 6);
       }},
  };
  for (const Case& type : types)
    for (const hid_t stored : {type.little, type.big})
      for (const auto& [name, set] : filters) {
        SCOPED_TRACE(std::string(name) + " of " + std::to_string(size_of(type.type)) + " bytes");
        const std::string samples = sample_bytes(type.type, kWhole, kExtent);
        create(dir / "v.h5", stored, set, [&](hid_t data) {
          ASSERT_GE(H5Dwrite(data, type.native, H5S_ALL, H5S_ALL, H5P_DEFAULT, samples.data()), 0);
        });
        for (const int threads : {1, 4}) expect_samples(dir / "v.h5", type.type, threads);
      }
}

void set_attribute(hid_t data, const char* name, hid_t type, hsize_t count, const void* values) {
  const hid_t space = H5Screate_simple(1, &count, nullptr);
  const hid_t attribute = H5Acreate2(data, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
  EXPECT_GE(H5Awrite(attribute, type, values), 0);
  H5Aclose(attribute);
  H5Sclose(space);
}

/// Labels of the dimensions, slowest first, as h5py writes them.
void set_labels(hid_t data, const std::vector<const char*>& labels) {
  const hid_t text = H5Tcopy(H5T_C_S1);
  H5Tset_size(text, H5T_VARIABLE);
  set_attribute(data, "DIMENSION_LABELS", text, labels.size(), labels.data());
  H5Tclose(text);
}

/// The same as strings of one length, padded with zeros (h5py's arrays of 'S') or blanks.
void set_fixed_labels(hid_t data, const std::vector<const char*>& labels, std::size_t size,
                      char padding) {
  const hid_t text = H5Tcopy(H5T_C_S1);
  H5Tset_size(text, size);
  H5Tset_strpad(text, padding == ' ' ? H5T_STR_SPACEPAD : H5T_STR_NULLPAD);
  std::string raw;
  for (const char* label : labels) {
    raw += label;
    raw.resize((raw.size() + size - 1) / size * size, padding);
  }
  set_attribute(data, "DIMENSION_LABELS", text, labels.size(), raw.data());
  H5Tclose(text);
}

/// Replaces the labels of /v.
template <class Set>
void replace_labels(const std::string& path, const Set& set) {
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  const hid_t data = H5Dopen2(file, "v", H5P_DEFAULT);
  H5Adelete(data, "DIMENSION_LABELS");
  set(data);
  H5Dclose(data);
  H5Fclose(file);
}

/// The samples of sample_bytes() in the order of the labels, in channel 1 of 2 where there are any;
/// the sizes of its elements are 1, 2, … in the order x, y, z.
std::string write_labelled(const std::string& path, const std::vector<const char*>& labels,
                           hsize_t chunk) {
  const std::string samples = sample_bytes(ScalarType::i16, kWhole, kExtent);
  std::vector<hsize_t> sizes, chunks;
  std::vector<double> element;
  for (const char* label : labels) {
    const int axis = label[0] - 'x';
    sizes.push_back(label[0] == 'c' ? 2 : static_cast<hsize_t>(kExtent[axis]));
    chunks.push_back(std::min(sizes.back(), chunk));
    if (label[0] != 'c') element.push_back(axis + 1);
  }
  std::vector<std::int16_t> turned;
  std::vector<hsize_t> at(sizes.size(), 0);
  for (bool more = true; more;) {
    Int3 p;
    hsize_t channel = 1;
    for (std::size_t i = 0; i < at.size(); ++i) {
      if (labels[i][0] == 'c')
        channel = at[i];
      else
        p[labels[i][0] - 'x'] = static_cast<Index>(at[i]);
    }
    std::int16_t value = -1;
    if (channel == 1)
      std::memcpy(&value, samples.data() + 2 * linear_index(p, kExtent), sizeof value);
    turned.push_back(value);
    std::size_t i = at.size();
    while (i > 0 && ++at[i - 1] == sizes[i - 1]) at[--i] = 0;
    more = i > 0;
  }
  const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t how = H5Pcreate(H5P_DATASET_CREATE);
  const hid_t space = H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(), nullptr);
  if (chunk > 0) H5Pset_chunk(how, static_cast<int>(sizes.size()), chunks.data());
  const hid_t data = H5Dcreate2(file, "v", H5T_NATIVE_INT16, space, H5P_DEFAULT, how, H5P_DEFAULT);
  EXPECT_GE(H5Dwrite(data, H5T_NATIVE_INT16, H5S_ALL, H5S_ALL, H5P_DEFAULT, turned.data()), 0);
  set_labels(data, labels);
  set_attribute(data, "element_size_um", H5T_NATIVE_DOUBLE, 3, element.data());
  H5Dclose(data);
  H5Sclose(space);
  H5Pclose(how);
  H5Fclose(file);
  return path;
}

TEST_F(Hdf5, LabelsSayWhichDimensionIsWhich) {
  using Labels = std::vector<const char*>;
  for (const Labels& labels :
       {Labels{"z", "y", "x"}, Labels{"x", "y", "z"}, Labels{"x", "z", "y"}, Labels{"y", "x", "z"},
        Labels{"c", "x", "y", "z"}, Labels{"x", "y", "z", "c"}, Labels{"z", "x", "c", "y"}})
    for (const hsize_t chunk : {0, 4}) {
      const auto path = write_labelled(dir / "v.h5", labels, chunk);
      VolumeRequest request;
      if (labels.size() > 3) request.selection.channel = 1;
      const auto source = open_source(path, request);
      EXPECT_EQ(source->info().extent, kExtent);
      EXPECT_EQ(source->info().transform.spacing, (Vec3d{1, 2, 3}));
      EXPECT_EQ(read_box(*source, kWhole), sample_bytes(ScalarType::i16, kWhole, kExtent));
      const Box3 inner{{3, 2, 1}, {17, 16, 4}};
      EXPECT_EQ(read_box(*source, inner), sample_bytes(ScalarType::i16, inner, kExtent));
    }
  // Two alike are refused.
  const auto twice = write_labelled(dir / "twice.h5", {"z", "y", "x"}, 0);
  replace_labels(twice, [](hid_t data) { set_labels(data, {"x", "y", "x"}); });
  EXPECT_TRUE(contains(message_of<UsageError>([&] { open_source(twice, {}); }), "are called x"));
}

TEST_F(Hdf5, LabelsMayBeStringsOfOneLength) {
  using Labels = std::vector<const char*>;
  for (const Labels& labels :
       {Labels{"z", "y", "x"}, Labels{"x", "y", "z"}, Labels{"x", "y", "z", "channel"}})
    for (const auto& [size, padding] :
         {std::pair(1, '\0'), std::pair(8, '\0'), std::pair(8, ' ')}) {
      if (labels.size() > 3 && size == 1) continue;
      const auto path = write_labelled(dir / "v.h5", labels, 0);
      replace_labels(path, [&](hid_t data) {
        set_fixed_labels(data, labels, static_cast<std::size_t>(size), padding);
      });
      VolumeRequest request;
      if (labels.size() > 3) request.selection.channel = 1;
      const auto source = open_source(path, request);
      EXPECT_EQ(source->info().extent, kExtent);
      EXPECT_EQ(read_box(*source, kWhole), sample_bytes(ScalarType::i16, kWhole, kExtent));
    }
}

TEST_F(Hdf5, LabelsOfSomeDimensionsThatContradictTheirPlaceAreRefused) {
  using Labels = std::vector<const char*>;
  const auto path = write_labelled(dir / "v.h5", {"z", "y", "x"}, 0);
  const auto label = [&](const Labels& labels) {
    replace_labels(path, [&](hid_t data) { set_labels(data, labels); });
  };
  for (const Labels& labels :
       {Labels{"x", "", ""}, Labels{"x", "y", ""}, Labels{"", "", "z"}, Labels{"row", "x", ""}}) {
    label(labels);
    const std::string message = message_of<UsageError>([&] { open_source(path, {}); });
    EXPECT_TRUE(contains(message, "DIMENSION_LABELS name a dimension ")) << message;
    EXPECT_TRUE(contains(message, "v.h5")) << message;
  }
  // Labels that agree, or are of other axes, leave the order as it is.
  for (const Labels& labels :
       {Labels{"z", "", ""}, Labels{"", "y", "x"}, Labels{"", "", ""}, Labels{"row", "y", "x"}}) {
    label(labels);
    EXPECT_EQ(read_box(*open_source(path, {}), kWhole),
              sample_bytes(ScalarType::i16, kWhole, kExtent));
  }
  // A dimension of size 1 does not move the others.
  const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const std::array<hsize_t, 4> sizes{1, 4, 3, 2};
  const hid_t space = H5Screate_simple(4, sizes.data(), nullptr);
  const hid_t data =
      H5Dcreate2(file, "v", H5T_NATIVE_UINT8, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  set_labels(data, {"", "x", "y", "z"});
  H5Dclose(data);
  H5Sclose(space);
  H5Fclose(file);
  EXPECT_TRUE(contains(message_of<UsageError>([&] { open_source(path, {}); }), "taken for"));
  label({"x", "", "", ""});
  EXPECT_TRUE(
      contains(message_of<UsageError>([&] { open_source(path, {}); }), "for a channel or time"));
}

TEST_F(Hdf5, ChunksThatWereNeverWritten) {
  const std::int16_t fill = -7;
  const auto set = [&](hid_t how) {
    H5Pset_deflate(how, 6);
    H5Pset_fill_value(how, H5T_NATIVE_INT16, &fill);
  };
  // Only the first plane of the second layer of chunks.
  const std::vector<std::int16_t> plane(17 * 19, 1000);
  create(dir / "v.h5", H5T_STD_I16BE, set, [&](hid_t data) {
    const hsize_t at[3] = {2, 0, 0}, size[3] = {1, 17, 19};
    const hid_t there = H5Dget_space(data), here = H5Screate_simple(3, size, nullptr);
    H5Sselect_hyperslab(there, H5S_SELECT_SET, at, nullptr, size, nullptr);
    ASSERT_GE(H5Dwrite(data, H5T_NATIVE_INT16, here, there, H5P_DEFAULT, plane.data()), 0);
    H5Sclose(there);
    H5Sclose(here);
  });
  const auto source = open_source(dir / "v.h5", {});
  const std::string bytes = read_box(*source, kWhole);
  const auto* samples = reinterpret_cast<const std::int16_t*>(bytes.data());
  for_each_point(kWhole, [&](Int3 p) {
    ASSERT_EQ(samples[linear_index(p, kExtent)], p.z == 2 ? 1000 : fill) << p.x << p.y << p.z;
  });
}

TEST_F(Hdf5, ChunksThatSkippedAFilter) {
  std::vector<std::uint8_t> chunk(2 * 5 * 6);
  for (std::size_t i = 0; i < chunk.size(); ++i) chunk[i] = static_cast<std::uint8_t>(i);
  create(
      dir / "v.h5", H5T_STD_U8LE, [](hid_t how) { H5Pset_deflate(how, 6); },
      [&](hid_t data) {
        const hsize_t at[3] = {2, 5, 6};
        ASSERT_GE(H5Dwrite_chunk(data, H5P_DEFAULT, 1, at, chunk.size(), chunk.data()), 0);
      });
  const auto source = open_source(dir / "v.h5", {});
  const std::string read = read_box(*source, {{6, 5, 2}, {12, 10, 4}});
  EXPECT_EQ(read, std::string(chunk.begin(), chunk.end()));
}

TEST_F(Hdf5, DamagedChunksAreNamed) {
  const std::string samples = sample_bytes(ScalarType::u8, kWhole, kExtent);
  const std::pair<const char*, std::function<void(hid_t)>> filters[] = {
      {"unpack", [](hid_t how) { H5Pset_deflate(how, 6); }},
      {"checksum", [](hid_t how) { H5Pset_fletcher32(how); }}};
  for (const auto& [what, set] : filters) {
    haddr_t place = 0;
    create(dir / "v.h5", H5T_STD_U8LE, set, [&](hid_t data) {
      ASSERT_GE(H5Dwrite(data, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, samples.data()), 0);
      const hsize_t at[3] = {2, 5, 6};
      unsigned skipped = 0;
      hsize_t size = 0;
      ASSERT_GE(H5Dflush(data), 0);
      ASSERT_GE(H5Dget_chunk_info_by_coord(data, at, &skipped, &place, &size), 0);
    });
    std::string bytes = dir.read("v.h5");
    for (std::size_t i = 0; i < 8; ++i) bytes[place + i] = static_cast<char>(~bytes[place + i]);
    const auto source = open_source(dir.write("d.h5", bytes), {});
    const std::string message = message_of<DamageError>([&] { read_box(*source, kWhole); });
    EXPECT_TRUE(contains(message, "the chunk at [2, 5, 6]")) << message;
    EXPECT_TRUE(contains(message, what)) << message;
    // What does not touch it can be read, also after the failure.
    const Box3 first{{0, 0, 0}, {19, 17, 2}};
    EXPECT_EQ(read_box(*source, first), sample_bytes(ScalarType::u8, first, kExtent));
  }
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

TEST_F(Hdf5, DamagedFiles) {
  write("v.h5", 3);
  expect_damage_is_no_crash(dir, "d.h5", dir.read("v.h5"), 41);
}

TEST_F(Hdf5, Mutations) {
  write("v.h5", 3);
  expect_mutations_are_no_crash(dir, "m.h5", dir.read("v.h5"));
}

}  // namespace
}  // namespace isobrick

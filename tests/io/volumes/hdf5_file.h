#pragma once

#include <gtest/gtest.h>
#include <hdf5.h>

#include <string>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

constexpr Int3 kExtent{19, 17, 5};
constexpr Box3 kWhole{{0, 0, 0}, kExtent};

/// One dataset /v of 5 × 17 × 19 samples in chunks of 2 × 5 × 6, made by `set` of its
/// properties; `write` puts the samples.
template <class Set, class Write>
void create(const std::string& path, hid_t stored, Set&& set, Write&& write) {
  const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hsize_t sizes[3] = {5, 17, 19}, chunks[3] = {2, 5, 6};
  const hid_t space = H5Screate_simple(3, sizes, nullptr), how = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_chunk(how, 3, chunks);
  set(how);
  const hid_t data = H5Dcreate2(file, "v", stored, space, H5P_DEFAULT, how, H5P_DEFAULT);
  ASSERT_GE(data, 0);
  write(data);
  H5Dclose(data);
  H5Pclose(how);
  H5Sclose(space);
  H5Fclose(file);
}

}  // namespace isobrick

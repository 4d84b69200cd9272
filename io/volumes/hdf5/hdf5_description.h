#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <isobrick/array_view.h>
#include <isobrick/scalar.h>
#include "io/volumes/hdf5/hdf5_filters.h"
#include "io/volumes/hdf5/hdf5_library.h"

namespace isobrick::inline v0 {

// The datasets of an HDF5 file. The caller holds hdf5_mutex().

/// The dataset that is meant: `name`, or if that is empty the only one of three or
/// more dimensions. Throws UsageError that lists them otherwise.
std::string choose_hdf5_dataset(const std::string& path, hid_t file, const std::string& name);

/// Reports why a requested dataset cannot be opened: throws UsageError
/// where there is none, DamageError otherwise.
[[noreturn]] void refuse_hdf5_dataset(const std::string& path, hid_t file, const std::string& name);

/// Throws UsageError for samples that are no numbers of ours.
ScalarType read_hdf5_type(const std::string& path, hid_t dataset);
/// The library's name for a type in memory.
hid_t hdf5_native_type(ScalarType stored);
/// Whether samples in the file are of the other byte order than `type`'s in memory;
/// nothing where they differ in more than that.
std::optional<bool> hdf5_swapped(hid_t dataset, ScalarType type);

/// The sizes, fastest first, with the roles and directions of the attribute DIMENSION_LABELS.
/// `labelled` becomes whether it gives all roles.
std::vector<ArrayAxis> read_hdf5_axes(const std::string& path, hid_t dataset, bool& labelled);
/// The attribute `element_size_um` that Fiji and ilastik write, of the axes of space, fastest
/// first; or zeros.
Vec3d read_hdf5_element_size(hid_t dataset);

/// Throws UsageError for samples in other files, and for filters that are not there.
void check_hdf5_storage(const std::string& path, hid_t creation);
/// The filters of a dataset's chunks, where we can undo all of them; without chunk_bytes.
std::optional<Hdf5Encoding> read_hdf5_encoding(hid_t creation);
/// A sample of chunks that are not there; zero where the file leaves it open.
std::array<std::byte, 8> read_hdf5_fill(hid_t creation, ScalarType type);

}  // namespace isobrick

#include "io/volumes/hdf5/hdf5_description.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include <isobrick/error.h>
#include "core/printable.h"
#include "io/volumes/hdf5/hdf5_lzf.h"
#include "io/volumes/raw/text_header.h"

namespace isobrick::inline v0 {
namespace {

/// Names of datasets with three or more dimensions.
std::vector<std::string> find_volumes(hid_t file) {
  constexpr std::size_t kMax = 1000;
  std::vector<std::string> names;
  const auto visit = [](hid_t root, const char* name, const H5O_info_t* info, void* to) -> herr_t {
    auto& found = *static_cast<std::vector<std::string>*>(to);
    if (info->type != H5O_TYPE_DATASET) return 0;
    const Hdf5Handle dataset(H5Dopen2(root, name, H5P_DEFAULT), H5Dclose);
    const Hdf5Handle space(dataset.valid() ? H5Dget_space(dataset) : -1, H5Sclose);
    if (!space.valid() || H5Sget_simple_extent_ndims(space) < 3) return 0;
    found.emplace_back(name);
    return found.size() >= kMax ? 1 : 0;
  };
  H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_INC, visit, &names, H5O_INFO_BASIC);
  return names;
}

/// "/a, /b, …", as far as that is fit for a message.
std::string list_of(const std::vector<std::string>& names) {
  constexpr std::size_t kMax = 10;
  std::string list;
  for (std::size_t i = 0; i < std::min(names.size(), kMax); ++i)
    list += (i ? ", /" : "/") + printable(names[i], 60);
  return names.size() > kMax ? list + ", …" : list;
}

/// Numbers of an attribute, or none.
std::vector<double> read_numbers(hid_t dataset, const char* name) {
  constexpr hssize_t kMax = 16;
  if (H5Aexists(dataset, name) <= 0) return {};
  const Hdf5Handle attribute(H5Aopen(dataset, name, H5P_DEFAULT), H5Aclose);
  const Hdf5Handle space(attribute.valid() ? H5Aget_space(attribute) : -1, H5Sclose);
  const hssize_t count = space.valid() ? H5Sget_simple_extent_npoints(space) : 0;
  if (count < 1 || count > kMax) return {};
  std::vector<double> numbers(static_cast<std::size_t>(count));
  if (H5Aread(attribute, H5T_NATIVE_DOUBLE, numbers.data()) < 0) return {};
  return numbers;
}

/// The role of a dimension with a label such as "t", "time" or "C".
std::optional<AxisRole> role_of(const std::string& label) {
  if (label == "t" || label == "time") return AxisRole::time;
  if (label == "c" || label == "channel" || label == "channels") return AxisRole::channel;
  if (label == "x" || label == "y" || label == "z") return AxisRole::space;
  return std::nullopt;
}

std::optional<int> direction_of(const std::string& label) {
  return label.size() == 1 && label[0] >= 'x' && label[0] <= 'z' ? std::optional(label[0] - 'x')
                                                                 : std::nullopt;
}

/// Strings of any length of an attribute.
std::vector<std::string> read_variable_strings(hid_t attribute, hid_t type, std::size_t count) {
  std::vector<char*> raw(count, nullptr);
  const Hdf5Handle space(H5Aget_space(attribute), H5Sclose);
  const Hdf5Handle memory(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(memory, H5T_VARIABLE);
  H5Tset_cset(memory, H5Tget_cset(type));
  if (H5Aread(attribute, memory, raw.data()) < 0) return {};
  std::vector<std::string> strings;
  for (const char* text : raw) strings.emplace_back(text ? text : "");
  H5Dvlen_reclaim(memory, space, H5P_DEFAULT, raw.data());
  return strings;
}

/// Strings of one length, which end with zeros or blanks.
std::vector<std::string> read_fixed_strings(hid_t attribute, hid_t type, std::size_t count) {
  constexpr std::size_t kMax = 1 << 16;
  const std::size_t size = H5Tget_size(type);
  if (size == 0 || size > kMax) return {};
  std::string raw(size * count, '\0');
  if (H5Aread(attribute, type, raw.data()) < 0) return {};
  std::vector<std::string> strings;
  for (std::size_t i = 0; i < count; ++i) {
    std::string& text = strings.emplace_back(raw, i * size, size);
    text.resize(std::min(text.find('\0'), size));
    text.resize(text.find_last_not_of(' ') + 1);
  }
  return strings;
}

/// The strings of the attribute DIMENSION_LABELS, slowest dimension first; empty
/// where it is missing or not as it should be.
std::vector<std::string> read_labels(hid_t dataset, std::size_t dimensions) {
  constexpr const char* kName = "DIMENSION_LABELS";
  if (H5Aexists(dataset, kName) <= 0) return {};
  const Hdf5Handle attribute(H5Aopen(dataset, kName, H5P_DEFAULT), H5Aclose);
  const Hdf5Handle space(attribute.valid() ? H5Aget_space(attribute) : -1, H5Sclose);
  const Hdf5Handle type(attribute.valid() ? H5Aget_type(attribute) : -1, H5Tclose);
  if (!space.valid() || !type.valid() || H5Tget_class(type) != H5T_STRING ||
      H5Sget_simple_extent_npoints(space) != static_cast<hssize_t>(dimensions))
    return {};
  std::vector<std::string> labels = H5Tis_variable_str(type) > 0
                                        ? read_variable_strings(attribute, type, dimensions)
                                        : read_fixed_strings(attribute, type, dimensions);
  for (std::string& label : labels) label = lower(label);
  return labels;
}

void check_filters(const std::string& path, hid_t creation) {
  for (int i = 0; i < H5Pget_nfilters(creation); ++i) {
    unsigned flags = 0, values[1];
    std::size_t count = 0;
    char name[64] = {};
    const H5Z_filter_t filter = H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &count,
                                               values, sizeof(name), name, nullptr);
    if (H5Zfilter_avail(filter) > 0) continue;
    name[sizeof(name) - 1] = '\0';
    throw UsageError(
        fmt::format("'{}': the filter {} ('{}') is not there; HDF5_PLUGIN_PATH is "
                    "where libhdf5 looks for others' filters",
                    path, filter, printable(name, kHdf5MaxShown)));
  }
}

}  // namespace

std::string choose_hdf5_dataset(const std::string& path, hid_t file, const std::string& name) {
  if (!name.empty()) return name;
  const auto names = find_volumes(file);
  if (names.empty())
    throw UsageError(fmt::format("'{}' has no dataset of 3 or more dimensions", path));
  if (names.size() == 1) return names[0];
  throw UsageError(fmt::format("'{}' has {} datasets: choose one as '{}:/NAME' ({})", path,
                               names.size(), path, list_of(names)));
}

void refuse_hdf5_dataset(const std::string& path, hid_t file, const std::string& name) {
  const std::string shown = printable(name, kHdf5MaxShown);
  const Hdf5Handle group(H5Gopen2(file, name.c_str(), hdf5_access(H5P_GROUP_ACCESS)), H5Gclose);
  if (!group.valid() && H5Lexists(file, name.c_str(), hdf5_access(H5P_LINK_ACCESS)) > 0)
    hdf5_fail(path, fmt::format("'/{}' cannot be opened as a dataset", shown));
  const auto names = find_volumes(file);
  throw UsageError(
      fmt::format("'{}' has no dataset '/{}'; {}", path, shown,
                  names.empty() ? "nor any of 3 or more dimensions" : "it has " + list_of(names)));
}

ScalarType read_hdf5_type(const std::string& path, hid_t dataset) {
  const Hdf5Handle type(H5Dget_type(dataset), H5Tclose);
  const std::size_t size = H5Tget_size(type);
  const H5T_class_t kind = H5Tget_class(type);
  if (kind == H5T_FLOAT && (size == 2 || size == 4)) return ScalarType::f32;
  if (kind == H5T_FLOAT && size == 8) return ScalarType::f64;
  if (kind == H5T_INTEGER) {
    const bool is_signed = H5Tget_sign(type) == H5T_SGN_2;
    if (size == 1) return is_signed ? ScalarType::i8 : ScalarType::u8;
    if (size == 2) return is_signed ? ScalarType::i16 : ScalarType::u16;
    if (size == 4) return is_signed ? ScalarType::i32 : ScalarType::u32;
    if (size == 8) return is_signed ? ScalarType::i64 : ScalarType::u64;
  }
  constexpr const char* kinds[] = {"integers", "floats",     "times",
                                   "text",     "bits",       "opaque bytes",
                                   "records",  "references", "enumerated values",
                                   "lists",    "arrays"};
  throw UsageError(fmt::format("'{}': samples that are {} of {} bytes are not supported", path,
                               kind >= 0 && kind < 11 ? kinds[kind] : "unknown", size));
}

hid_t hdf5_native_type(ScalarType stored) {
  switch (stored) {
    case ScalarType::u8: return H5T_NATIVE_UINT8;
    case ScalarType::i8: return H5T_NATIVE_INT8;
    case ScalarType::u16: return H5T_NATIVE_UINT16;
    case ScalarType::i16: return H5T_NATIVE_INT16;
    case ScalarType::u32: return H5T_NATIVE_UINT32;
    case ScalarType::i32: return H5T_NATIVE_INT32;
    case ScalarType::f32: return H5T_NATIVE_FLOAT;
    case ScalarType::f64: break;
    case ScalarType::u64: return H5T_NATIVE_UINT64;
    case ScalarType::i64: return H5T_NATIVE_INT64;
  }
  return H5T_NATIVE_DOUBLE;
}

std::optional<bool> hdf5_swapped(hid_t dataset, ScalarType type) {
  const Hdf5Handle stored(H5Dget_type(dataset), H5Tclose);
  if (H5Tequal(stored, hdf5_native_type(type)) > 0) return false;
  const Hdf5Handle other(H5Tcopy(hdf5_native_type(type)), H5Tclose);
  H5Tset_order(other, H5Tget_order(other) == H5T_ORDER_LE ? H5T_ORDER_BE : H5T_ORDER_LE);
  return H5Tequal(stored, other) > 0 ? std::optional(true) : std::nullopt;
}

std::optional<Hdf5Encoding> read_hdf5_encoding(hid_t creation) {
  unsigned options = 0;
  // Chunks at the border may be stored without filters; they are not marked.
  if (H5Pget_chunk_opts(creation, &options) < 0 || options != 0) return std::nullopt;
  Hdf5Encoding encoding;
  bool compressed = false;
  for (int i = 0; i < H5Pget_nfilters(creation); ++i) {
    unsigned flags = 0, values[1] = {0};
    std::size_t count = 1;
    const H5Z_filter_t filter = H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &count,
                                               values, 0, nullptr, nullptr);
    if (filter == H5Z_FILTER_DEFLATE || filter == kHdf5LzfFilter) {
      if (std::exchange(compressed, true)) return std::nullopt;
      encoding.filters.push_back(filter == kHdf5LzfFilter ? Hdf5Filter::lzf : Hdf5Filter::deflate);
    } else if (filter == H5Z_FILTER_SHUFFLE && count > 0 && values[0] > 0) {
      if (encoding.element != 1 && encoding.element != values[0]) return std::nullopt;
      encoding.element = values[0];
      encoding.filters.push_back(Hdf5Filter::shuffle);
    } else if (filter == H5Z_FILTER_FLETCHER32) {
      encoding.filters.push_back(Hdf5Filter::fletcher32);
    } else {
      return std::nullopt;
    }
  }
  return encoding;
}

std::array<std::byte, 8> read_hdf5_fill(hid_t creation, ScalarType type) {
  std::array<std::byte, 8> fill{};
  H5D_fill_value_t status = H5D_FILL_VALUE_UNDEFINED;
  if (H5Pfill_value_defined(creation, &status) >= 0 && status != H5D_FILL_VALUE_UNDEFINED)
    H5Pget_fill_value(creation, hdf5_native_type(type), fill.data());
  return fill;
}

std::vector<ArrayAxis> read_hdf5_axes(const std::string& path, hid_t dataset, bool& labelled) {
  const Hdf5Handle space(H5Dget_space(dataset), H5Sclose);
  const int dimensions = H5Sget_simple_extent_ndims(space);
  if (dimensions < 3)
    throw UsageError(fmt::format("'{}': a dataset of {} dimensions is no volume", path,
                                 std::max(dimensions, 0)));
  std::vector<hsize_t> sizes(static_cast<std::size_t>(dimensions));
  H5Sget_simple_extent_dims(space, sizes.data(), nullptr);
  const auto labels = read_labels(dataset, sizes.size());
  std::vector<ArrayAxis> axes;
  labelled = !labels.empty();
  for (std::size_t i = sizes.size(); i-- > 0;) {
    const auto role = labels.empty() ? std::nullopt : role_of(labels[i]);
    labelled = labelled && role;
    if (sizes[i] > static_cast<hsize_t>(std::numeric_limits<Index>::max()))
      throw UsageError(fmt::format("'{}': a dimension of {} is too large", path, sizes[i]));
    axes.push_back({static_cast<Index>(sizes[i]), role.value_or(AxisRole::space),
                    labels.empty() ? std::nullopt : direction_of(labels[i])});
  }
  return axes;
}

Vec3d read_hdf5_element_size(hid_t dataset) {
  const auto size = read_numbers(dataset, "element_size_um");
  if (size.size() != 3 || !(std::min({size[0], size[1], size[2]}) > 0)) return {};
  return {size[2], size[1], size[0]};
}

void check_hdf5_storage(const std::string& path, hid_t creation) {
  if (H5Pget_external_count(creation) > 0)
    throw UsageError(fmt::format("'{}': samples in other files are not supported", path));
  if (H5Pget_layout(creation) == H5D_VIRTUAL)
    throw UsageError(fmt::format("'{}': virtual datasets are not supported", path));
  check_filters(path, creation);
}

}  // namespace isobrick

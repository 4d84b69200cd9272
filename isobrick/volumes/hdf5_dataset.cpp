#include "isobrick/volumes/hdf5_dataset.h"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <mutex>
#include <utility>

#include "isobrick/core/error.h"
#include "isobrick/io/file.h"
#include "isobrick/volumes/text_header.h"

namespace isobrick {
namespace {

std::mutex& library_mutex() {
  static std::mutex mutex;
  return mutex;
}

/// Owns a handle of any kind.
class Handle {
 public:
  Handle() = default;
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  operator hid_t() const { return id_; }
  bool valid() const { return id_ >= 0; }

 private:
  hid_t id_ = -1;
  herr_t (*close_)(hid_t) = nullptr;
};

/// What the library says of the innermost failure, fit for one line.
std::string complaint() {
  std::string text;
  const auto keep = [](unsigned, const H5E_error2_t* error, void* to) -> herr_t {
    std::string& kept = *static_cast<std::string*>(to);
    if (kept.empty() && error->desc != nullptr) kept = std::string(error->desc).substr(0, 200);
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, keep, &text);
  for (char& c : text)
    if (c < 0x20 || c >= 0x7f) c = '?';
  return text.empty() ? text : " (" + text + ")";
}

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw DamageError(fmt::format("'{}': {}{}", path, what, complaint()));
}

/// Names of datasets with three or more dimensions.
std::vector<std::string> find_volumes(hid_t file) {
  constexpr std::size_t kMost = 1000;
  std::vector<std::string> names;
  const auto visit = [](hid_t root, const char* name, const H5O_info_t* info, void* to) -> herr_t {
    auto& found = *static_cast<std::vector<std::string>*>(to);
    if (info->type != H5O_TYPE_DATASET) return 0;
    const Handle dataset(H5Dopen2(root, name, H5P_DEFAULT), H5Dclose);
    const Handle space(dataset.valid() ? H5Dget_space(dataset) : -1, H5Sclose);
    if (!space.valid() || H5Sget_simple_extent_ndims(space) < 3) return 0;
    found.emplace_back(name);
    return found.size() >= kMost ? 1 : 0;
  };
  H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_INC, visit, &names, H5O_INFO_BASIC);
  return names;
}

std::string choose_name(const std::string& path, hid_t file, const std::string& name) {
  if (!name.empty()) return name;
  const auto names = find_volumes(file);
  if (names.empty())
    throw UsageError(fmt::format("'{}' has no dataset of 3 or more dimensions", path));
  if (names.size() == 1) return names[0];
  std::string list;
  for (std::size_t i = 0; i < std::min<std::size_t>(names.size(), 10); ++i)
    list += (i ? ", /" : "/") + names[i].substr(0, 60);
  for (char& c : list)
    if (c >= 0 && c < 0x20) c = '?';
  throw UsageError(fmt::format("'{}' has {} datasets: choose one as '{}:/NAME' ({}{})", path,
                               names.size(), path, list, names.size() > 10 ? ", …" : ""));
}

/// Links must not lead into other files.
herr_t refuse_link(const char*, const char*, const char*, const char*, unsigned*, hid_t, void*) {
  return -1;
}

ScalarType read_type(const std::string& path, hid_t dataset) {
  const Handle type(H5Dget_type(dataset), H5Tclose);
  const std::size_t size = H5Tget_size(type);
  const H5T_class_t kind = H5Tget_class(type);
  if (kind == H5T_FLOAT && (size == 2 || size == 4)) return ScalarType::f32;
  if (kind == H5T_FLOAT && size == 8) return ScalarType::f64;
  if (kind == H5T_INTEGER) {
    const bool is_signed = H5Tget_sign(type) == H5T_SGN_2;
    if (size == 1) return is_signed ? ScalarType::i8 : ScalarType::u8;
    if (size == 2) return is_signed ? ScalarType::i16 : ScalarType::u16;
    if (size == 4) return is_signed ? ScalarType::i32 : ScalarType::u32;
  }
  constexpr const char* kinds[] = {"integers", "floats",     "times",
                                   "text",     "bits",       "opaque bytes",
                                   "records",  "references", "enumerated values",
                                   "lists",    "arrays"};
  throw UsageError(fmt::format("'{}': samples that are {} of {} bytes are not supported", path,
                               kind >= 0 && kind < 11 ? kinds[kind] : "unknown", size));
}

hid_t native_type(ScalarType type) {
  switch (type) {
    case ScalarType::u8: return H5T_NATIVE_UINT8;
    case ScalarType::i8: return H5T_NATIVE_INT8;
    case ScalarType::u16: return H5T_NATIVE_UINT16;
    case ScalarType::i16: return H5T_NATIVE_INT16;
    case ScalarType::u32: return H5T_NATIVE_UINT32;
    case ScalarType::i32: return H5T_NATIVE_INT32;
    case ScalarType::f32: return H5T_NATIVE_FLOAT;
    case ScalarType::f64: break;
  }
  return H5T_NATIVE_DOUBLE;
}

/// Numbers of an attribute, or none.
std::vector<double> read_numbers(hid_t dataset, const char* name) {
  constexpr hssize_t kMost = 16;
  if (H5Aexists(dataset, name) <= 0) return {};
  const Handle attribute(H5Aopen(dataset, name, H5P_DEFAULT), H5Aclose);
  const Handle space(attribute.valid() ? H5Aget_space(attribute) : -1, H5Sclose);
  const hssize_t count = space.valid() ? H5Sget_simple_extent_npoints(space) : 0;
  if (count < 1 || count > kMost) return {};
  std::vector<double> numbers(static_cast<std::size_t>(count));
  if (H5Aread(attribute, H5T_NATIVE_DOUBLE, numbers.data()) < 0) return {};
  return numbers;
}

/// What a label such as "t", "time" or "C" says of its dimension.
std::optional<AxisRole> role_of(const std::string& label) {
  if (label == "t" || label == "time") return AxisRole::time;
  if (label == "c" || label == "channel" || label == "channels") return AxisRole::channel;
  if (label == "x" || label == "y" || label == "z") return AxisRole::space;
  return std::nullopt;
}

/// The strings of the attribute DIMENSION_LABELS, slowest dimension first; empty
/// where it is missing or not as it should be.
std::vector<std::string> read_labels(hid_t dataset, std::size_t dimensions) {
  constexpr const char* kName = "DIMENSION_LABELS";
  if (H5Aexists(dataset, kName) <= 0) return {};
  const Handle attribute(H5Aopen(dataset, kName, H5P_DEFAULT), H5Aclose);
  const Handle space(attribute.valid() ? H5Aget_space(attribute) : -1, H5Sclose);
  const Handle type(attribute.valid() ? H5Aget_type(attribute) : -1, H5Tclose);
  if (!space.valid() || !type.valid() || H5Tis_variable_str(type) <= 0 ||
      H5Sget_simple_extent_npoints(space) != static_cast<hssize_t>(dimensions))
    return {};
  std::vector<char*> raw(dimensions, nullptr);
  const Handle memory(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(memory, H5T_VARIABLE);
  H5Tset_cset(memory, H5Tget_cset(type));
  if (H5Aread(attribute, memory, raw.data()) < 0) return {};
  std::vector<std::string> labels;
  for (const char* text : raw) labels.push_back(text ? lower(text) : "");
  H5Dvlen_reclaim(memory, space, H5P_DEFAULT, raw.data());
  return labels;
}

}  // namespace

struct Hdf5Dataset::Handles {
  std::string path;
  Handle file, dataset;
  ScalarType type = ScalarType::u8;
  std::vector<ArrayAxis> axes;
  bool labelled = false;
  Vec3d element_size;
  std::size_t memory = 0;

  void open(const std::string& name);
  void open_dataset(const std::string& name, std::size_t cache);
  void read_axes();
  void check_filters(hid_t creation) const;
  std::size_t chunk_memory(std::size_t& cache) const;
};

void Hdf5Dataset::Handles::open_dataset(const std::string& name, std::size_t cache) {
  const Handle access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
  H5Pset_elink_cb(access, refuse_link, nullptr);
  // A few thousand slots, a prime, so that chunks seldom share one.
  constexpr std::size_t kSlots = 10007;
  if (cache > 0) H5Pset_chunk_cache(access, kSlots, cache, 1.0);
  dataset = Handle(H5Dopen2(file, name.c_str(), access), H5Dclose);
  if (!dataset.valid()) fail(path, fmt::format("there is no dataset '/{}'", name.substr(0, 200)));
}

void Hdf5Dataset::Handles::read_axes() {
  const Handle space(H5Dget_space(dataset), H5Sclose);
  const int dimensions = H5Sget_simple_extent_ndims(space);
  if (dimensions < 3)
    throw UsageError(fmt::format("'{}': a dataset of {} dimensions is no volume", path,
                                 std::max(dimensions, 0)));
  std::vector<hsize_t> sizes(static_cast<std::size_t>(dimensions));
  H5Sget_simple_extent_dims(space, sizes.data(), nullptr);
  const auto labels = read_labels(dataset, sizes.size());
  labelled = !labels.empty();
  for (std::size_t i = sizes.size(); i-- > 0;) {
    const auto role = labels.empty() ? std::nullopt : role_of(labels[i]);
    labelled = labelled && role;
    if (sizes[i] > static_cast<hsize_t>(std::numeric_limits<Index>::max()))
      throw UsageError(fmt::format("'{}': a dimension of {} is too large", path, sizes[i]));
    axes.push_back({static_cast<Index>(sizes[i]), role.value_or(AxisRole::space)});
  }
}

void Hdf5Dataset::Handles::check_filters(hid_t creation) const {
  for (int i = 0; i < H5Pget_nfilters(creation); ++i) {
    unsigned flags = 0, values[1];
    std::size_t count = 0;
    char name[64] = {};
    const H5Z_filter_t filter = H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &count,
                                               values, sizeof(name), name, nullptr);
    if (H5Zfilter_avail(filter) > 0) continue;
    name[sizeof(name) - 1] = '\0';
    for (char& c : name)
      if (c < 0x20 && c != '\0') c = '?';
    throw UsageError(
        fmt::format("'{}': the filter {} ('{}') is not there; HDF5_PLUGIN_PATH says "
                    "where libhdf5 looks for others' filters",
                    path, filter, name));
  }
}

/// What decoding takes, and in `cache` a layer of chunks if that is not much:
/// slabs that end within chunks need these twice.
std::size_t Hdf5Dataset::Handles::chunk_memory(std::size_t& cache) const {
  const Handle creation(H5Dget_create_plist(dataset), H5Pclose);
  if (H5Pget_external_count(creation) > 0)
    throw UsageError(fmt::format("'{}': samples in other files are not supported", path));
  const H5D_layout_t layout = H5Pget_layout(creation);
  if (layout == H5D_VIRTUAL)
    throw UsageError(fmt::format("'{}': virtual datasets are not supported", path));
  check_filters(creation);
  cache = 0;
  if (layout != H5D_CHUNKED) return 0;
  std::vector<hsize_t> chunk(axes.size());
  if (H5Pget_chunk(creation, static_cast<int>(chunk.size()), chunk.data()) < 0)
    fail(path, "the chunks have no size");
  constexpr double kMost = 0x1p40, kEnough = 0x1p26;
  double one = static_cast<double>(size_of(type)), layer = one;
  for (std::size_t i = 0; i < chunk.size(); ++i) {
    const auto edge = static_cast<double>(chunk[chunk.size() - 1 - i]);
    const double size = static_cast<double>(axes[i].size);
    one *= edge;
    layer *= i + 1 < chunk.size() ? std::max(edge, size + edge) : edge;
  }
  if (!(one < kMost))
    throw UsageError(fmt::format("'{}': chunks of {} bytes are too large", path, one));
  cache = static_cast<std::size_t>(layer <= kEnough ? layer : one);
  return cache + 2 * static_cast<std::size_t>(one);
}

void Hdf5Dataset::Handles::open(const std::string& name) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  open_input(path);  // says better than the library why a file cannot be opened
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_file_locking(access, false, true);
  file = Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose);
  if (!file.valid()) fail(path, "cannot be read as an HDF5 file");
  const std::string chosen = choose_name(path, file, name);
  open_dataset(chosen, 0);
  type = read_type(path, dataset);
  read_axes();
  const auto size = read_numbers(dataset, "element_size_um");
  if (size.size() == 3 && std::min({size[0], size[1], size[2]}) > 0)
    element_size = {size[2], size[1], size[0]};
  std::size_t cache = 0;
  memory = chunk_memory(cache);
  if (cache == 0) return;
  dataset = {};
  open_dataset(chosen, cache);
}

Hdf5Dataset::Hdf5Dataset(const std::string& path, const std::string& name)
    : handles_(std::make_unique<Handles>()) {
  handles_->path = path;
  const std::lock_guard lock(library_mutex());
  try {
    handles_->open(name);
  } catch (...) {
    handles_.reset();  // with the lock held
    throw;
  }
}

Hdf5Dataset::~Hdf5Dataset() {
  const std::lock_guard lock(library_mutex());
  handles_.reset();
}

ScalarType Hdf5Dataset::type() const { return handles_->type; }
const std::vector<ArrayAxis>& Hdf5Dataset::axes() const { return handles_->axes; }
bool Hdf5Dataset::labelled() const { return handles_->labelled; }
Vec3d Hdf5Dataset::element_size() const { return handles_->element_size; }
std::size_t Hdf5Dataset::memory() const { return handles_->memory; }

void Hdf5Dataset::read(const std::vector<Index>& start, const std::vector<Index>& count,
                       std::byte* out) const {
  const std::lock_guard lock(library_mutex());
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // the error stack is the thread's
  std::vector<hsize_t> from(start.rbegin(), start.rend()), size(count.rbegin(), count.rend());
  const Handle space(H5Dget_space(handles_->dataset), H5Sclose);
  const Handle memory(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr),
                      H5Sclose);
  if (H5Sselect_hyperslab(space, H5S_SELECT_SET, from.data(), nullptr, size.data(), nullptr) < 0 ||
      H5Dread(handles_->dataset, native_type(handles_->type), memory, space, H5P_DEFAULT, out) < 0)
    fail(handles_->path, "samples cannot be read");
}

}  // namespace isobrick

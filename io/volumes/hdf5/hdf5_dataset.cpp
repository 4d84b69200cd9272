#include "io/volumes/hdf5/hdf5_dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <string_view>
#include <utility>

#include <isobrick/error.h>
#include "io/bytes/file.h"
#include "io/volumes/hdf5/hdf5_chunks.h"
#include "io/volumes/hdf5/hdf5_description.h"
#include "io/volumes/hdf5/hdf5_library.h"
#include "io/volumes/hdf5/hdf5_lzf.h"

namespace isobrick::inline v0 {
namespace {

/// Whether the innermost failure is that a chunk was never written: of the function
/// that sizes it, and of none that looks it up. Newer versions report no failure.
bool chunk_is_missing() {
  bool missing = false;
  const auto look = [](unsigned n, const H5E_error2_t* error, void* to) -> herr_t {
    if (n == 0)
      *static_cast<bool*>(to) = error->func_name == std::string_view("H5D__get_chunk_storage_size");
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, look, &missing);
  return missing;
}

/// For the library to decode chunks: a layer of them, which slabs that end within
/// chunks need twice, or one if a layer is much.
std::size_t cache_bytes(const std::vector<ArrayAxis>& axes, const std::vector<Index>& edges,
                        std::size_t chunk) {
  constexpr double kEnough = 0x1p26;
  double layer = static_cast<double>(chunk);
  for (std::size_t i = 0; i + 1 < edges.size(); ++i)
    layer *= static_cast<double>(ceil_div(axes[i].size, edges[i]));
  return layer <= kEnough ? static_cast<std::size_t>(layer) : chunk;
}

}  // namespace

struct Hdf5Dataset::Handles {
  std::string path;
  Hdf5Handle file, dataset;
  ScalarType type;
  std::vector<ArrayAxis> axes;
  bool labelled = false;
  Vec3d element_size;
  std::size_t memory = 0;
  std::optional<Hdf5Chunks> chunks;  ///< where they are decoded by us

  void open(const std::string& name, int threads);
  void open_dataset(const std::string& name, std::size_t cache);
  std::vector<Index> chunk_edges(hid_t creation) const;
  bool decode_chunks(hid_t creation, const std::vector<Index>& edges, int threads);
  std::optional<std::uint32_t> fetch_chunk(const std::vector<Index>& first, std::size_t most,
                                           PodBuffer<std::byte>& bytes) const;
  void read(const std::vector<Index>& start, const std::vector<Index>& count, std::byte* out) const;
};

void Hdf5Dataset::Handles::open_dataset(const std::string& name, std::size_t cache) {
  const Hdf5Handle access = hdf5_access(H5P_DATASET_ACCESS);
  // A few thousand slots, a prime, so that chunks seldom share one.
  constexpr std::size_t kSlots = 10007;
  if (cache > 0) H5Pset_chunk_cache(access, kSlots, cache, 1.0);
  dataset = Hdf5Handle(H5Dopen2(file, name.c_str(), access), H5Dclose);
  if (!dataset.valid()) refuse_hdf5_dataset(path, file, name);
}

/// Fastest first; empty where there are no chunks.
std::vector<Index> Hdf5Dataset::Handles::chunk_edges(hid_t creation) const {
  if (H5Pget_layout(creation) != H5D_CHUNKED) return {};
  std::vector<hsize_t> chunk(axes.size());
  if (H5Pget_chunk(creation, static_cast<int>(chunk.size()), chunk.data()) !=
      static_cast<int>(chunk.size()))
    hdf5_fail(path, "the chunks have no size");
  constexpr double kMax = 0x1p40;
  double bytes = static_cast<double>(size_of(type));
  for (const hsize_t edge : chunk) bytes *= static_cast<double>(edge);
  if (!(bytes >= 1 && bytes < kMax))
    throw UsageError(fmt::format("'{}': chunks of {} bytes are too large", path, bytes));
  return {chunk.rbegin(), chunk.rend()};
}

/// Prepares decoding without the library, where we know how.
bool Hdf5Dataset::Handles::decode_chunks(hid_t creation, const std::vector<Index>& edges,
                                         int threads) {
  const std::optional<bool> swap = hdf5_swapped(dataset, type);
  std::optional<Hdf5Encoding> encoding = read_hdf5_encoding(creation);
  if (!swap || !encoding) return false;
  encoding->chunk_bytes = size_of(type);
  for (const Index edge : edges) encoding->chunk_bytes *= static_cast<std::size_t>(edge);
  if (encoding->chunk_bytes > kMaxHdf5Chunk) return false;
  Hdf5ChunkLayout layout{
      path, {}, edges, *encoding, size_of(type), *swap, read_hdf5_fill(creation, type)};
  for (const ArrayAxis& axis : axes) layout.extent.push_back(axis.size);
  const auto fetch = [this, most = encoding->max_packed()](const std::vector<Index>& first,
                                                           PodBuffer<std::byte>& bytes) {
    return fetch_chunk(first, most, bytes);
  };
  chunks.emplace(std::move(layout), fetch, threads);
  return true;
}

std::optional<std::uint32_t> Hdf5Dataset::Handles::fetch_chunk(const std::vector<Index>& first,
                                                               std::size_t most,
                                                               PodBuffer<std::byte>& bytes) const {
  const std::lock_guard lock(hdf5_mutex());
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // the error stack is the thread's
  const std::vector<hsize_t> at(first.rbegin(), first.rend());
  const auto where = [&] { return fmt::format("the chunk at [{}]", fmt::join(at, ", ")); };
  hsize_t size = 0;
  if (H5Dget_chunk_storage_size(dataset, at.data(), &size) < 0) {
    if (chunk_is_missing()) return std::nullopt;
    hdf5_fail(path, where() + " cannot be found");
  }
  if (size == 0) return std::nullopt;
  if (size > most)
    throw DamageError(fmt::format("'{}': {} would have {} bytes, more than any of its samples",
                                  path, where(), size));
  bytes.resize(static_cast<std::size_t>(size));
  std::uint32_t skipped = 0;
  if (H5Dread_chunk(dataset, H5P_DEFAULT, at.data(), &skipped, bytes.data()) < 0)
    hdf5_fail(path, where() + " cannot be read");
  return skipped;
}

void Hdf5Dataset::Handles::open(const std::string& name, int threads) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  register_hdf5_lzf();
  open_input(path);  // reports better than the library why a file cannot be opened
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_file_locking(access, false, true);
  file = Hdf5Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose);
  if (!file.valid()) hdf5_fail(path, "cannot be read as an HDF5 file");
  const std::string chosen = choose_hdf5_dataset(path, file, name);
  open_dataset(chosen, 0);
  type = read_hdf5_type(path, dataset);
  axes = read_hdf5_axes(path, dataset, labelled);
  element_size = read_hdf5_element_size(dataset);
  const Hdf5Handle creation(H5Dget_create_plist(dataset), H5Pclose);
  check_hdf5_storage(path, creation);
  const std::vector<Index> edges = chunk_edges(creation);
  if (edges.empty()) return;
  if (decode_chunks(creation, edges, threads)) {
    memory = chunks->memory();
    return;
  }
  std::size_t chunk = size_of(type);
  for (const Index edge : edges) chunk *= static_cast<std::size_t>(edge);
  const std::size_t cache = cache_bytes(axes, edges, chunk);
  memory = cache + 2 * chunk;
  dataset = {};
  open_dataset(chosen, cache);
}

void Hdf5Dataset::Handles::read(const std::vector<Index>& start, const std::vector<Index>& count,
                                std::byte* out) const {
  const std::lock_guard lock(hdf5_mutex());
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // the error stack is the thread's
  const std::vector<hsize_t> from(start.rbegin(), start.rend()), size(count.rbegin(), count.rend());
  const Hdf5Handle space(H5Dget_space(dataset), H5Sclose);
  const Hdf5Handle box(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr),
                       H5Sclose);
  if (H5Sselect_hyperslab(space, H5S_SELECT_SET, from.data(), nullptr, size.data(), nullptr) < 0 ||
      H5Dread(dataset, hdf5_native_type(type), box, space, H5P_DEFAULT, out) < 0)
    hdf5_fail(path, "samples cannot be read");
}

Hdf5Dataset::Hdf5Dataset(const std::string& path, const std::string& name, int threads)
    : handles_(std::make_unique<Handles>()) {
  handles_->path = path;
  const std::lock_guard lock(hdf5_mutex());
  try {
    handles_->open(name, threads);
  } catch (...) {
    handles_.reset();  // with the lock held
    throw;
  }
}

Hdf5Dataset::~Hdf5Dataset() {
  const std::lock_guard lock(hdf5_mutex());
  handles_.reset();
}

ScalarType Hdf5Dataset::type() const { return handles_->type; }
const std::vector<ArrayAxis>& Hdf5Dataset::axes() const { return handles_->axes; }
bool Hdf5Dataset::labelled() const { return handles_->labelled; }
Vec3d Hdf5Dataset::element_size() const { return handles_->element_size; }
std::size_t Hdf5Dataset::memory() const { return handles_->memory; }

void Hdf5Dataset::read(const std::vector<Index>& start, const std::vector<Index>& count,
                       std::byte* out) {
  if (handles_->chunks)
    handles_->chunks->read(start, count, out);
  else
    handles_->read(start, count, out);
}

}  // namespace isobrick

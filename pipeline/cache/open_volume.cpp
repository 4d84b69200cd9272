#include <isobrick/open_volume.h>

#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include <isobrick/convert.h>
#include <isobrick/error.h>
#include <isobrick/storage.h>
#include "bricks/storage/open_storage.h"
#include "bricks/zarr/metadata_files.h"
#include "core/cancellable_progress.h"
#include "core/file_error.h"
#include "core/shell_word.h"
#include "io/bytes/folder_walk.h"
#include "io/bytes/leftovers.h"
#include "io/volumes/open/volume_format.h"
#include "pipeline/cache/cache_entry.h"
#include "pipeline/convert/convert_staging.h"
#include "pipeline/convert/store_source.h"
#include "pipeline/index/add_ranges.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Changes when stores that were made of the same input would be others.
constexpr int kKeyVersion = 2;

/// Whether a store is read in place: its samples and their places stay as they are.
bool takes_all(const VolumeRequest& request) {
  return !request.spacing && !request.origin && !request.unit && !request.roi && !request.region &&
         !request.nodata && request.stride == Int3{1, 1, 1};
}

/// A line of a key: the name of a file, its number, its size and the times of its last changes.
std::string identity_of(const fs::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) throw system_error("look at", path, errno);
  std::error_code none;
  fs::path full = fs::weakly_canonical(path, none);
  if (none) full = path;
  return fmt::format("{} {} {} {}.{:09} {}.{:09}\n", full.string(), status.st_ino, status.st_size,
                     status.st_mtim.tv_sec, status.st_mtim.tv_nsec, status.st_ctim.tv_sec,
                     status.st_ctim.tv_nsec);
}

/// The same of a Zarr, whose chunks are written without its metadata: how many files it has, their
/// bytes, and the last change of any.
std::string identity_of_folder(const fs::path& path) {
  std::uint64_t files = 0, bytes = 0;
  timespec last{};
  walk_folder(path, [&](const fs::path& file, fs::file_type) {
    struct stat status {};
    if (::lstat((path / file).c_str(), &status) != 0) return true;
    files += 1;
    bytes += static_cast<std::uint64_t>(status.st_size);
    if (std::pair(status.st_ctim.tv_sec, status.st_ctim.tv_nsec) >
        std::pair(last.tv_sec, last.tv_nsec))
      last = status.st_ctim;
    return true;
  });
  return fmt::format("{} {} {}.{:09}\n", files, bytes, last.tv_sec, last.tv_nsec);
}

std::string text_of(const RegionRequest& region) {
  std::string text;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto bound = [](const std::optional<Index>& b) { return b ? std::to_string(*b) : ""; };
    text += fmt::format("{}:{},", bound(region.lo[axis]), bound(region.hi[axis]));
  }
  return text;
}

std::string text_of(Vec3d v) { return fmt::format("{},{},{}", v.x, v.y, v.z); }

/// What of a request decides on the samples and their places.
std::string text_of(const VolumeRequest& r) {
  std::string text;
  const auto add = [&](const char* name, const auto& value, const auto& text_of_value) {
    if (value) text += fmt::format("{} {}\n", name, text_of_value(*value));
  };
  const auto plain = [](const auto& v) { return fmt::format("{}", v); };
  add("dims", r.extent, [](Int3 e) { return fmt::format("{},{},{}", e.x, e.y, e.z); });
  add("type", r.type, [](ScalarType t) { return zarr_name(t); });
  add("order", r.order, [](ByteOrder o) { return o == ByteOrder::big ? "big" : "little"; });
  add("offset", r.offset, plain);
  add("spacing", r.spacing, [](Vec3d v) { return text_of(v); });
  add("origin", r.origin, [](Vec3d v) { return text_of(v); });
  add("unit", r.unit, plain);
  add("channel", r.selection.channel, plain);
  add("time", r.selection.time, plain);
  add("grid", r.grid, plain);
  add("bounds", r.bounds, [](const RegionRequest& v) { return text_of(v); });
  add("roi", r.roi, [](const RegionRequest& v) { return text_of(v); });
  add("region", r.region, [](const WorldRegion& v) { return text_of(v.lo) + ":" + text_of(v.hi); });
  add("nodata", r.nodata, plain);
  return text + fmt::format("stride {},{},{}\n", r.stride.x, r.stride.y, r.stride.z);
}

/// What a store is made of.
std::string key_of(const std::string& path, const VolumeInfo& info, const OpenOptions& options) {
  std::string key = fmt::format("{}\n{}", kKeyVersion, text_of(options.volume));
  if (options.downsampling) key += fmt::format("downsample {}\n", name_of(*options.downsampling));
  if (fs::is_directory(path) && is_zarr(path))
    return key + identity_of(path) + identity_of_folder(path);
  if (const auto place = find_folder_in_zip(path)) key += fmt::format("folder {}\n", place->folder);
  for (const fs::path& file : info.files) key += identity_of(file);
  return key;
}

/// What a storage may fetch ahead of a budget. More gains nothing on links of ten gigabits.
std::uint64_t remote_memory(std::uint64_t budget) {
  return std::clamp<std::uint64_t>(budget / 8, std::uint64_t{1} << 20, RemoteOptions().memory);
}

/// A folder for one OpenedVolume, in that of temporary files.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    const std::string name = (temporary_folder() / "isobrick").string();
    remove_leftovers(name, true);
    folder_ = create_temporary_folder(name);
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(folder_.path, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  fs::path store() const { return fs::path(folder_.path) / "store.zarr"; }

 private:
  Temporary folder_;
};

}  // namespace

fs::path default_cache_folder() {
  const auto variable = [](const char* name) -> fs::path {
    const char* value = std::getenv(name);
    return value != nullptr ? value : "";
  };
  if (const fs::path cache = variable("XDG_CACHE_HOME"); cache.is_absolute())
    return cache / "isobrick";
  if (const fs::path home = variable("HOME"); home.is_absolute())
    return home / ".cache" / "isobrick";
  return {};
}

struct OpenedVolume::Impl {
  std::vector<std::string> notes;
  bool converted = false;
  std::optional<TemporaryFolder> temporary;
  std::optional<CacheEntry> entry;
  std::optional<StoreReader> store;

  Impl(const std::string& path, const OpenOptions& options, Progress& progress) {
    VolumeRequest request = options.volume;
    request.memory = options.memory;
    request.threads = options.threads;
    const bool in_place = is_zarr(path) && takes_all(request);
    if (in_place) {
      refuse_raw_description(path, "Zarr", request);
      refuse_grid(path, request);
      RemoteOptions remote;
      remote.memory = remote_memory(options.memory);
      remote.cache_folder = options.cache.folder;
      remote.cache_limit = options.cache.remote_limit;
      remote.on_note = options.on_note;
      store.emplace(open_storage(path, remote), request.selection);
      if (!options.needs_ranges || has_all_ranges(*store)) return;
      store.reset();
    }
    const auto source = open_any_source(path, request);
    if (options.cache.folder.empty() || source->info().files.empty())
      fill_temporary(path, *source, options, progress);
    else
      fill_entry(path, *source, options, progress);
  }

  void fill_temporary(const std::string& path, VolumeSource& source, const OpenOptions& options,
                      Progress& progress) {
    temporary.emplace();
    convert_to(temporary->store(), "a temporary store", path, source, options, progress);
    store.emplace(temporary->store());
  }

  void fill_entry(const std::string& path, VolumeSource& source, const OpenOptions& options,
                  Progress& progress) {
    const fs::path& cache = options.cache.folder;
    const std::string key = key_of(path, source.info(), options);
    entry.emplace(cache, volume_stem(path), key, progress);
    if (!entry->is_filled() && !entry->can_be_filled()) {
      entry.reset();
      return fill_temporary(path, source, options, progress);
    }
    if (!entry->is_filled()) {
      entry->clear();
      convert_to(entry->store(), fmt::format("the cache ('{}')", entry->store().string()), path,
                 source, options, progress);
      if (key_of(path, source.info(), options) != key)
        throw Error(
            fmt::format("'{}' changed while it was converted; run the command again", path));
      entry->set_filled();
    }
    entry->share();
    shrink_cache(cache, options.cache.limit);
    store.emplace(entry->store());
  }

  void add_note(const OpenOptions& options, std::string note) {
    notes.push_back(std::move(note));
    if (options.on_note) options.on_note(notes.back());
  }

  /// `place` is what messages call `out`.
  void convert_to(const fs::path& out, const std::string& place, const std::string& path,
                  VolumeSource& source, const OpenOptions& options, Progress& progress) {
    add_note(options, fmt::format("converting '{}' into {}", path, place));
    if (fs::is_directory(path) && is_zarr(path) && takes_all(options.volume))
      add_note(options, fmt::format("without that copy: '{}' adds what it lacks in place",
                                    "isobrick index " + shell_word(path)));
    std::error_code none;
    ConvertOptions convert_options;
    convert_options.memory = options.memory;
    convert_options.downsampling = options.downsampling;
    convert_options.threads = options.threads;
    convert_options.force = true;  // what a change of the input has left
    convert_options.resume = fs::exists(staging_path(out), none);
    convert(source, out, convert_options, progress);
    converted = true;
    for (std::string& note : source.notes()) add_note(options, std::move(note));
  }
};

OpenedVolume::OpenedVolume(const std::string& path, const OpenOptions& options,
                           Progress& listener) {
  CancellableProgress progress(listener, options.cancel);
  impl_ = std::make_unique<Impl>(path, options, progress);
}
OpenedVolume::~OpenedVolume() = default;
OpenedVolume::OpenedVolume(OpenedVolume&&) noexcept = default;

const StoreReader& OpenedVolume::store() const { return *impl_->store; }
bool OpenedVolume::converted() const { return impl_->converted; }
const std::vector<std::string>& OpenedVolume::notes() const { return impl_->notes; }

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/downsampling.h>
#include <isobrick/progress.h>
#include <isobrick/store_reader.h>
#include <isobrick/volume_request.h>

namespace isobrick::inline v0 {

/// Where the stores of volumes that are no stores themselves are kept, and bytes of remote ones.
struct CacheOptions {
  /// Empty: nothing is kept; the store is in the folder of temporary files and goes with the
  /// OpenedVolume.
  std::filesystem::path folder = {};
  /// Bytes of all stores in the folder. The ones that were used longest ago are removed first,
  /// never one that a process has open.
  std::uint64_t limit = std::uint64_t{20} << 30;
  /// Bytes of remote stores that are kept in the folder, beside that limit; see RemoteOptions. 0:
  /// nothing is kept of them.
  std::uint64_t remote_limit = 0;
};

/// $XDG_CACHE_HOME/isobrick, else ~/.cache/isobrick; empty where neither is known.
ISOBRICK_API std::filesystem::path default_cache_folder();

/// How a volume is opened.
struct OpenOptions {
  VolumeRequest volume = {};  ///< what is known of it, and which of its samples are requested
  CacheOptions cache = {};    ///< where stores that are made are kept
  /// Whether another program's Zarr without ranges is converted; false: it is opened in place.
  bool needs_ranges = true;
  std::optional<Downsampling> downsampling = {};  ///< of a conversion, see ConvertOptions
  std::uint64_t memory = std::uint64_t{1} << 30;  ///< budget of the conversion, bytes
  int threads = 0;                                ///< 0: all cores
  /// Called with each of OpenedVolume::notes() when it comes up, which is before a conversion
  /// begins; from the thread that opens. Later, from any thread, with a note that nothing more is
  /// kept of a remote store. May be empty.
  std::function<void(const std::string&)> on_note = {};
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
};

/// A volume that can be read as a store, whatever its format.
class ISOBRICK_API OpenedVolume {
 public:
  /// Opens a store in place where it has ranges and the request takes all of it as it is. Anything
  /// else is converted: what open_source() opens, another program's Zarr without ranges, a store of
  /// which a part is requested. It is not where the cache has the store of the same request and the
  /// same files, by name, size and times. Waits for another process that is converting the same.
  /// Throws what StoreReader, open_source() and convert() do, and Error for an input that changes
  /// while it is converted.
  explicit OpenedVolume(const std::string& path, const OpenOptions& options = {},
                        Progress& progress = no_progress());
  ~OpenedVolume();
  /// Takes the store of another.
  OpenedVolume(OpenedVolume&&) noexcept;

  /// The store. Valid as long as this.
  const StoreReader& store() const;
  /// Whether it was converted just now.
  bool converted() const;
  /// Remarks for the user, a sentence each: that there is a conversion and where its store is kept,
  /// and those of the source.
  const std::vector<std::string>& notes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Opens any volume as a store: OpenedVolume.
inline OpenedVolume open(const std::string& path, const OpenOptions& options = {},
                         Progress& progress = no_progress()) {
  return OpenedVolume(path, options, progress);
}

}  // namespace isobrick

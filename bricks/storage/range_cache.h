#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "io/bytes/file.h"

namespace isobrick::inline v0 {

/// What a server says of an object: bytes of the same state are the same.
struct ObjectState {
  std::uint64_t size = 0;
  std::string etag = {}, last_modified = {};  ///< headers of its replies, or ""

  /// Whether another state of the object can be told from this one.
  bool is_known() const { return !etag.empty() || !last_modified.empty(); }
  std::uint64_t hash() const;
  friend bool operator==(const ObjectState&, const ObjectState&) = default;
};

/// What is known of an object since the server was last asked.
struct CachedState {
  bool is_missing = false;       ///< there is no such object; it has no state
  ObjectState state = {};        ///< of one that is there
  std::int64_t fresh_until = 0;  ///< seconds since 1970: until then the server need not be asked
  std::uint64_t root = 0;        ///< hash of the state of its store's metadata at that time
};

/// Files in the folder "remote" of a cache: states of remote objects, and ranges of their bytes.
/// Their bytes are limited. Files that were used longest ago go first. Several processes may use
/// the folder at once. A file appears under its name when it is whole. Thread-safe. No function
/// throws: what cannot be read is not there, and what cannot be written is noted once.
class RangeCache {
 public:
  using Note = std::function<void(const std::string&)>;

  /// `on_note` is called when a file cannot be written, from the thread that writes. May be empty.
  RangeCache(const std::filesystem::path& cache, std::uint64_t limit, Note on_note);

  /// The folder of an object, which need not exist. `url` has all that tells it from others.
  std::filesystem::path folder_of(const std::string& url) const;
  /// What is known of the object of a folder; nullopt where nothing is.
  std::optional<CachedState> find(const std::filesystem::path& folder) const;
  void put(const std::filesystem::path& folder, const CachedState& state);
  /// The server is to be asked again.
  void forget(const std::filesystem::path& folder);
  /// Something in the store with the root of a folder has changed. The number of its last change,
  /// 0 where none is known.
  void note_change(const std::filesystem::path& root_folder);
  std::uint64_t last_change(const std::filesystem::path& root_folder) const;

  /// Writes a file of these parts, one after another. False where it is not kept.
  bool write(const std::filesystem::path& file,
             std::initializer_list<std::span<const std::byte>> parts);
  /// Removes a file that is of no use.
  void remove(const std::filesystem::path& file);

 private:
  UniqueFd open_temporary(const std::filesystem::path& file, std::uint64_t size);
  bool make_room(std::uint64_t bytes);
  std::uint64_t shrink(std::uint64_t limit) const;
  void give_up(const std::string& what, int why);

  std::filesystem::path folder_;
  std::uint64_t limit_;
  Note on_note_;
  std::mutex mutex_;
  UniqueFd total_;  ///< file of the bytes of all files; its lock is held while that changes
  bool is_writable_ = false;
};

}  // namespace isobrick

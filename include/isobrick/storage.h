#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/progress.h>

namespace isobrick::inline v0 {

/// An object of a storage, open to read. Thread-safe.
class ISOBRICK_API StoredObject {
 public:
  virtual ~StoredObject() = default;

  /// How messages name it, without quotes: "scan.zarr/0/c/0/0/1".
  virtual std::string name() const = 0;
  /// Bytes that it has.
  virtual std::uint64_t size() const = 0;
  /// Fills `bytes` with those from `offset` on. Throws DamageError where the object ends before,
  /// Error where it cannot be read.
  virtual void read(std::uint64_t offset, std::span<std::byte> bytes) const = 0;
  /// Hints that these bytes are read soon: an implementation may begin to fetch them, several such
  /// ranges together. Waits for nothing and throws nothing.
  virtual void will_need(std::uint64_t offset, std::uint64_t size) const;
};

/// What a store is read from: objects by key, a relative name such as "0/c/0/0/1", whose parts "/"
/// separates. No key has an empty part, "." or "..". Read only and thread-safe. For a place of your
/// own derive from this class, or use function_storage().
class ISOBRICK_API Storage {
 public:
  virtual ~Storage() = default;

  /// How messages name it, without quotes: "scan.zarr".
  virtual std::string name() const = 0;
  /// How messages name the object of a key, be it there or not: "scan.zarr.zip:/0/c/0/0/1".
  virtual std::string name_of(const std::string& key) const;
  /// Opens an object; null where there is none. Throws Error where it cannot be known. A reader
  /// keeps at most 128 objects open, and may close and open them again.
  virtual std::shared_ptr<const StoredObject> open(const std::string& key) const = 0;
  /// Hints that an object is opened soon: an implementation may begin to. Waits for nothing and
  /// throws nothing.
  virtual void will_open(const std::string& key) const;
  /// The first part of each key below "`folder`/", or of each key where `folder` is empty; in no
  /// particular order. Throws Error where it cannot be known.
  virtual std::vector<std::string> list(const std::string& folder) const = 0;
  /// Whether objects are on another machine: reads take long to begin, hints count.
  virtual bool is_remote() const;
  /// Bytes of objects that it holds at most to make reads fast.
  virtual std::uint64_t memory() const;
  /// The folder or file on this machine in which all objects lie; empty where there is none.
  virtual std::filesystem::path local_path() const;
};

/// The files in a folder: "x/y" is the file y in its folder x.
ISOBRICK_API std::shared_ptr<const Storage> folder_storage(const std::filesystem::path& folder);

/// The entries of a zip, which must be stored without compression. The keys are the names of the
/// entries, or what follows "TOP/" in them where the only Zarr in the zip lies in its folder TOP.
/// Keeps the names of the entries in memory, never their bytes. Throws DamageError for a zip that
/// is damaged; opening a compressed or an encrypted entry throws Error.
ISOBRICK_API std::shared_ptr<const Storage> zip_storage(const std::filesystem::path& file);
/// The same of a zip that is itself an object of some storage.
ISOBRICK_API std::shared_ptr<const Storage> zip_storage(std::shared_ptr<const StoredObject> zip);

/// Objects in memory, by key. `name` is for messages.
ISOBRICK_API std::shared_ptr<const Storage> memory_storage(
    std::map<std::string, std::vector<std::byte>> objects, std::string name = "memory");

/// What a storage is made of by function_storage(). Called by several threads at once.
struct StorageFunctions {
  /// Bytes of the object of a key; nullopt where there is none.
  std::function<std::optional<std::uint64_t>(const std::string& key)> size;
  /// Fills `bytes` with those of an object from `offset` on, which all lie within it.
  std::function<void(const std::string& key, std::uint64_t offset, std::span<std::byte> bytes)>
      read;
  /// As Storage::list(); empty: nothing is listed, so that `info` and verify() see no index.
  std::function<std::vector<std::string>(const std::string& folder)> list;
};

/// A storage of the caller's functions; what they throw reaches the reader. `name` is for messages.
/// Throws UsageError where `size` or `read` is empty.
ISOBRICK_API std::shared_ptr<const Storage> function_storage(StorageFunctions functions,
                                                             std::string name);

/// How objects behind a URL are read.
struct RemoteOptions {
  std::uint64_t memory = std::uint64_t{64} << 20;  ///< bytes that are fetched ahead at most
  int max_requests = 64;                           ///< under way at the same time
  /// Of each request: failures of the network and the statuses 408, 429, 500, 502, 503 and 504 are
  /// tried again, after pauses that double, or the one that the server asks for.
  int tries = 7;
  double timeout_seconds = 30;  ///< without a connection or a byte
  /// A cache on the disk: what was read is kept in the folder "remote" of this one, for whoever
  /// reads it next. The server is asked whether an object has changed: of the metadata of the root
  /// always, of others when ten minutes have gone by (or as Cache-Control says), or the root has
  /// changed. Empty: nothing is kept.
  std::filesystem::path cache_folder = {};
  /// Bytes of all that is kept there; what was used longest ago goes first. 0: nothing is kept.
  std::uint64_t cache_limit = 0;
  /// Called once where the cache cannot be written to, from a thread that opens or reads. Reading
  /// goes on without. May be empty.
  std::function<void(const std::string&)> on_note = {};
  /// Ends requests, and reads that wait for them, with Cancelled.
  std::stop_token cancel = {};
};

/// The objects below a URL: https://…, http://… or s3://BUCKET/PATH. Reads ranges of bytes, many at
/// a time, and those of StoredObject::will_need() ahead; close ones with one request. Where a
/// server names the state of an object (ETag), all its bytes are of one state.
///
/// S3: the variables AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_SESSION_TOKEN, AWS_PROFILE,
/// AWS_REGION, AWS_ENDPOINT_URL_S3 and the files ~/.aws/credentials and ~/.aws/config count, as for
/// Amazon's tools. Without credentials, or with AWS_NO_SIGN_REQUEST, requests are anonymous. A
/// place that may not be looked at (403) counts as empty, because S3 says so of missing objects.
///
/// Objects of http and https cannot be listed: list() returns nothing. Throws UsageError for a URL
/// that makes no sense or where this was built without libcurl; reads throw Error.
ISOBRICK_API std::shared_ptr<const Storage> remote_storage(const std::string& url,
                                                           const RemoteOptions& options = {});

/// A folder, a zip or the URL of either, whichever `path` is. Throws Error where it is neither or
/// cannot be looked at, and what zip_storage() and remote_storage() do. The options are for URLs.
ISOBRICK_API std::shared_ptr<const Storage> open_storage(const std::filesystem::path& path,
                                                         const RemoteOptions& options = {});

/// How write_zip() writes.
struct ZipOptions {
  bool force = false;  ///< replace a file that exists, once the new one is whole
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
};

/// Writes all objects of `storage` into one zip at `out`, `-` for standard output, stored without
/// compression: what zip_storage() reads. Metadata come first, and equal objects make equal bytes.
/// Keeps their keys in memory, and a few MB. Nothing appears under the final name until it is
/// whole. Throws UsageError where `out` exists and `force` is not set. Returns the bytes of the
/// zip.
ISOBRICK_API std::uint64_t write_zip(const Storage& storage, const std::filesystem::path& out,
                                     const ZipOptions& options = {},
                                     Progress& progress = no_progress());

}  // namespace isobrick

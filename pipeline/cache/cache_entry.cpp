#include "pipeline/cache/cache_entry.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "core/file_error.h"
#include "core/text_hash.h"
#include "io/bytes/folder_walk.h"
#include "io/bytes/leftovers.h"
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// A name that file systems take, of what the user calls the volume.
std::string plain_name(const std::string& name) {
  std::string plain = name.substr(0, 60);
  std::replace_if(
      plain.begin(), plain.end(),
      [](unsigned char c) { return std::isalnum(c) == 0 && c != '-' && c != '_' && c != '.'; },
      '_');
  return plain.empty() || plain.front() == '.' ? "volume" + plain : plain;
}

/// The folder of an entry, and whether a name is one: nobody else's folders are removed. Entries of
/// one hash tell each other apart by their keys.
std::string folder_name(const std::string& name, const std::string& key) {
  return fmt::format("{}-{:016x}", plain_name(name), text_hash(key));
}
bool is_folder_name(const std::string& name) {
  constexpr std::size_t digits = 16;
  if (name.size() <= digits || name[name.size() - digits - 1] != '-') return false;
  return name.find_first_not_of("0123456789abcdef", name.size() - digits) == name.npos;
}

fs::path lock_file(const fs::path& folder) { return folder / "lock"; }
fs::path description_file(const fs::path& folder) { return folder / "entry.json"; }

/// Opens the lock of an entry; nothing where the folder is not there.
UniqueFd open_lock(const fs::path& folder) {
  return UniqueFd(::open(lock_file(folder).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
}

/// Whether the lock is still that of the folder: an entry may be removed before it is locked.
bool is_current(const UniqueFd& lock, const fs::path& folder) {
  struct stat opened {
  }, named{};
  return ::fstat(lock.get(), &opened) == 0 && ::stat(lock_file(folder).c_str(), &named) == 0 &&
         opened.st_ino == named.st_ino && opened.st_dev == named.st_dev;
}

void make_folder(const fs::path& folder) {
  std::error_code failure;
  fs::create_directories(folder, failure);
  if (failure)
    throw Error(
        fmt::format("cannot make the folder '{}' of the cache ({}): choose another with "
                    "--cache DIR, or --cache none",
                    folder.string(), failure.message()));
}

/// How many files a folder holds, and their bytes. Cleaners of caches take single ones.
struct FolderSize {
  std::uint64_t files = 0, bytes = 0;
  friend bool operator==(const FolderSize&, const FolderSize&) = default;
};

FolderSize size_of(const fs::path& folder) {
  FolderSize size;
  try {
    walk_folder(folder, [&](const fs::path& file, fs::file_type type) {
      std::error_code none;
      if (type != fs::file_type::regular) return true;
      const auto bytes = fs::file_size(folder / file, none);
      size.files += 1;
      size.bytes += none ? 0 : bytes;
      return true;
    });
  } catch (const Error&) {
    return {};  // it was removed meanwhile
  }
  return size;
}

/// The content of entry.json; all empty where there is none that makes sense.
struct Description {
  std::string key;
  FolderSize store;
};

Description description_of(const fs::path& folder) {
  std::ifstream file(description_file(folder));
  const nlohmann::json object = nlohmann::json::parse(file, nullptr, false);
  try {
    return {object.at("key").get<std::string>(),
            {object.at("files").get<std::uint64_t>(), object.at("bytes").get<std::uint64_t>()}};
  } catch (const nlohmann::json::exception&) {
    return {};
  }
}

struct Candidate {
  fs::path folder;
  std::uint64_t bytes;
  fs::file_time_type used;
};

std::vector<Candidate> candidates_in(const fs::path& cache) {
  std::vector<Candidate> candidates;
  std::error_code failure;
  for (fs::directory_iterator entry(cache, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    std::error_code none;
    const fs::path folder = entry->path();
    if (!is_folder_name(folder.filename().string()) || !fs::exists(lock_file(folder), none))
      continue;
    const Description description = description_of(folder);
    // What was not finished goes first.
    const bool whole = !description.key.empty();
    const auto used =
        whole ? fs::last_write_time(lock_file(folder), none) : fs::file_time_type::min();
    candidates.push_back({folder, whole ? description.store.bytes : size_of(folder).bytes, used});
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.used < b.used; });
  return candidates;
}

/// Whether the entry was removed; not where a process holds it.
bool remove_entry(const fs::path& folder) {
  const UniqueFd lock = open_lock(folder);
  if (lock.get() < 0 || ::flock(lock.get(), LOCK_EX | LOCK_NB) != 0 || !is_current(lock, folder))
    return false;
  std::error_code failure;
  // What says that the store is whole goes first, the lock last. What else is there keeps the
  // folder.
  fs::remove(description_file(folder), failure);
  remove_leftovers(description_file(folder).string());
  for (const char* name : {"store.zarr", "store.zarr.partial"})
    fs::remove_all(folder / name, failure);
  fs::remove(lock_file(folder), failure);
  return fs::remove(folder, failure);
}

}  // namespace

CacheEntry::CacheEntry(const fs::path& cache, const std::string& name, std::string key,
                       Progress& progress)
    : folder_(cache / folder_name(name, key)), key_(std::move(key)) {
  for (bool waits = false;;) {
    make_folder(folder_);
    lock_ = open_lock(folder_);
    if (lock_.get() < 0 && errno == ENOENT) continue;  // removed just now
    if (lock_.get() < 0) {
      const int why = errno;
      writable_ = false;  // others share what they have made
      lock_ = UniqueFd(::open(lock_file(folder_).c_str(), O_RDONLY | O_CLOEXEC));
      if (lock_.get() < 0) throw system_error("open", lock_file(folder_), why);
    }
    if (::flock(lock_.get(), (writable_ ? LOCK_EX : LOCK_SH) | LOCK_NB) == 0) {
      if (is_current(lock_, folder_)) break;
      continue;
    }
    // A reader of what is there needs no turn of its own.
    if (::flock(lock_.get(), LOCK_SH | LOCK_NB) == 0 && is_current(lock_, folder_) && is_filled())
      break;
    if (!waits) progress.begin("wait for the cache", 0);
    waits = true;
    progress.advance(0);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

bool CacheEntry::is_filled() const {
  const Description description = description_of(folder_);
  return description.key == key_ && description.store == size_of(store());
}

void CacheEntry::clear() {
  std::error_code ignored;
  fs::remove(description_file(folder_), ignored);
  fs::remove_all(store(), ignored);
}

void CacheEntry::set_filled() {
  const FolderSize size = size_of(store());
  OutputFile file(description_file(folder_), true);
  file.writer().append(
      nlohmann::json{{"key", key_}, {"files", size.files}, {"bytes", size.bytes}}.dump());
  file.publish();
}

void CacheEntry::share() {
  static_cast<void>(::flock(lock_.get(), LOCK_SH));
  static_cast<void>(::futimens(lock_.get(), nullptr));
}

void shrink_cache(const fs::path& cache, std::uint64_t limit) {
  const std::vector<Candidate> candidates = candidates_in(cache);
  std::uint64_t bytes = 0;
  for (const Candidate& candidate : candidates) bytes += candidate.bytes;
  for (const Candidate& candidate : candidates) {
    if (bytes <= limit) return;
    if (remove_entry(candidate.folder)) bytes -= candidate.bytes;
  }
}

}  // namespace isobrick

#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <filesystem>
#include <mutex>
#include <set>
#include <span>
#include <string_view>
#include <thread>
#include <vector>

#include "io/bytes/file.h"
#include "io/bytes/output_folder.h"

namespace isobrick::inline v0 {

/// Syncs finished files of a folder and gives them their final names, on threads of its own
/// so that nobody waits for the disk; the queue is bounded all the same. Several
/// threads, because a file system commits syncs that come together at once.
/// Failures come out of the next call.
class Publisher {
 public:
  /// All files are below `root`, which exists.
  explicit Publisher(const std::filesystem::path& root);
  /// Finishes what was given; failures are lost, so call wait() first.
  ~Publisher();

  /// Where the files are.
  const OutputFolder& folder() const { return folder_; }

  /// Takes a file written under its temporary name.
  void publish(File temporary, std::filesystem::path path);
  /// Takes a file that only needs to be synced, and keeps the name that it has.
  void sync(File file);
  /// Creates the temporary file of `path`.
  File create_temporary(const std::filesystem::path& path) const;
  /// Removes it, if it is there; throws nothing.
  void discard_temporary(const std::filesystem::path& path) const noexcept;
  /// Writes a whole file under the temporary name of `path`, and no more.
  File write_temporary(const std::filesystem::path& path, std::span<const std::byte> content);
  /// Writes a whole file under a temporary name and publishes it, small ones on
  /// the publisher's threads.
  void write(const std::filesystem::path& path, std::span<const std::byte> content);
  void write(const std::filesystem::path& path, std::string_view text);
  /// Returns when all files are on disk under their final names, the entries of
  /// the folders included.
  void wait();

  /// Bytes of all files; writers of their own files add theirs.
  void count(std::uint64_t bytes) { bytes_ += bytes; }
  std::uint64_t bytes() const { return bytes_; }

 private:
  struct Job {
    enum class Kind : std::uint8_t { publish, sync_file, sync_directory, write };
    Kind kind = Kind::publish;
    File file;
    std::filesystem::path path;      ///< the final one
    std::vector<std::byte> content;  ///< of a file that is still to be written
  };
  void add(Job job, const std::filesystem::path& parent);
  void run();
  void run(Job& job) const;
  /// Gives a temporary file its final name once it is on disk.
  void publish_now(File temporary, const std::filesystem::path& path) const;
  /// Wakes a thread, or makes one when all have something to do.
  void start_thread();
  void drain(std::unique_lock<std::mutex>& lock);
  void rethrow_failure();

  OutputFolder folder_;
  std::atomic<std::uint64_t> bytes_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> queue_;
  std::set<std::filesystem::path> directories_;  // whose entries are not yet durable
  std::exception_ptr failure_;
  std::size_t busy_ = 0;
  bool stop_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace isobrick

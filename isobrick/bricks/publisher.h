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

#include "isobrick/bricks/store_file.h"

namespace isobrick {

/// Syncs finished files and gives them their final names, on threads of its own
/// so that nobody waits for the disk; the queue is bounded all the same. Several
/// threads, because a file system commits syncs that come together at once.
/// Failures come out of the next call.
class Publisher {
 public:
  explicit Publisher(std::filesystem::path root);
  /// Finishes what was given; failures are lost, so call wait() first.
  ~Publisher();

  /// Takes a file written under its temporary name.
  void publish(StoreFile temporary, std::filesystem::path path);
  /// Writes a whole file under a temporary name and publishes it.
  void write(const std::filesystem::path& path, std::span<const std::byte> content);
  void write(const std::filesystem::path& path, std::string_view text);
  /// Returns when all files are on disk under their final names, the entries of
  /// the folders included.
  void wait();

  /// Bytes of all files; writers of their own files add theirs.
  void count(std::uint64_t bytes) { bytes_ += bytes; }
  std::uint64_t bytes() const { return bytes_; }

 private:
  /// A file to sync and rename, or without one a directory to sync.
  struct Job {
    StoreFile file;
    std::filesystem::path path;
    void run();
  };
  void run();
  void drain(std::unique_lock<std::mutex>& lock);
  void rethrow_failure();

  std::filesystem::path root_;
  std::atomic<std::uint64_t> bytes_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> queue_;
  std::set<std::filesystem::path> directories_;  // whose entries are not yet durable
  std::exception_ptr failure_;
  int busy_ = 0;
  bool stop_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace isobrick

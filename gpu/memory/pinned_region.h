#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "gpu/memory/mapped_pages.h"

namespace isobrick::inline v0::gpu {

/// Page-locked host memory in chunks, which a thread of its own makes ready one after the other
/// while others begin to work: as many cores as its maker has to itself touch a chunk, then the
/// driver locks it. Thread-safe.
class PinnedRegion {
 public:
  /// Chunks of so many bytes, in the order in which they are needed. Throws Error where there
  /// is no room.
  PinnedRegion(int device, const std::vector<std::size_t>& chunks);
  PinnedRegion(const PinnedRegion&) = delete;
  PinnedRegion& operator=(const PinnedRegion&) = delete;
  /// Nothing is copied from or to it any more.
  ~PinnedRegion();

  /// A chunk, for the processor; waits until it has been touched.
  std::byte* touched(std::size_t chunk) { return wait_for(chunk, touched_); }
  /// A chunk, for the device as well; waits until it is locked. Throws Error when it cannot be.
  std::byte* locked(std::size_t chunk) { return wait_for(chunk, locked_); }

 private:
  std::size_t count() const { return offsets_.size() - 1; }
  std::byte* at(std::size_t chunk) const { return pages_.data() + offsets_[chunk]; }
  std::size_t bytes(std::size_t chunk) const { return offsets_[chunk + 1] - offsets_[chunk]; }

  void run();
  bool stopped();
  void advance(std::size_t& count);
  std::byte* wait_for(std::size_t chunk, const std::size_t& count);

  int device_, threads_;
  std::vector<std::size_t> offsets_;  ///< where each chunk begins, and the end
  MappedPages pages_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t touched_ = 0, locked_ = 0;  ///< the first so many chunks
  bool stop_ = false;
  std::exception_ptr error_;

  std::thread thread_;
};

}  // namespace isobrick::gpu

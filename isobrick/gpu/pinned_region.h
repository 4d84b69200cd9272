#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "isobrick/gpu/mapped_pages.h"

namespace isobrick::gpu {

/// Page-locked host memory in pieces, which a thread of its own gets one after the other while
/// others begin to work: as many cores as its maker has to itself touch a piece, then the driver
/// locks it.
class PinnedRegion {
 public:
  /// Pieces of so many bytes, in the order in which they are needed. Throws Error where there
  /// is no room.
  PinnedRegion(int device, const std::vector<std::size_t>& pieces);
  PinnedRegion(const PinnedRegion&) = delete;
  PinnedRegion& operator=(const PinnedRegion&) = delete;
  /// Nothing is copied from or to it any more.
  ~PinnedRegion();

  /// A piece, for the processor; waits until it has been touched.
  std::byte* touched(std::size_t piece) { return wait_for(piece, touched_); }
  /// A piece, for the device as well; waits until it is locked. Throws Error when it cannot be.
  std::byte* locked(std::size_t piece) { return wait_for(piece, locked_); }

 private:
  void run();
  bool stopped();
  void advance(std::size_t& count);
  std::byte* wait_for(std::size_t piece, const std::size_t& count);
  std::byte* at(std::size_t piece) const { return pages_.data() + offsets_[piece]; }
  std::size_t bytes(std::size_t piece) const { return offsets_[piece + 1] - offsets_[piece]; }

  int device_, threads_;
  std::vector<std::size_t> offsets_;  ///< of the pieces, and the end
  MappedPages pages_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t touched_ = 0, locked_ = 0;  ///< the first so many pieces
  bool stop_ = false;
  std::exception_ptr error_;

  std::thread thread_;
};

}  // namespace isobrick::gpu

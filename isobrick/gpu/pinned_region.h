#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "isobrick/gpu/locked_pieces.h"

namespace isobrick::gpu {

/// Page-locked host memory in pieces, which a thread of its own gets one after the other while
/// others begin to work: as many cores as its maker has to itself touch a piece, then the driver
/// locks it. Unless there are spare pages of these sizes.
class PinnedRegion {
 public:
  /// Pieces of so many bytes, in the order in which they are needed. Throws Error where there
  /// is no room.
  PinnedRegion(int device, const std::vector<std::size_t>& pieces);
  PinnedRegion(const PinnedRegion&) = delete;
  PinnedRegion& operator=(const PinnedRegion&) = delete;
  /// Nothing is copied from or to it any more. The pages are spare now, or go.
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

  int device_, threads_;
  LockedPieces pieces_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t touched_ = 0, locked_ = 0;  ///< the first so many pieces
  bool stop_ = false;
  std::exception_ptr error_;

  std::thread thread_;
};

}  // namespace isobrick::gpu

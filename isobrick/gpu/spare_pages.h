#pragma once

#include <cstddef>
#include <mutex>
#include <optional>
#include <vector>

#include "isobrick/gpu/locked_pieces.h"

namespace isobrick::gpu {

/// Page-locked memory that one extraction has given back, for the next one of the process: to
/// touch, lock and unlock it takes a tenth of a short extraction. Of each of the sizes that the
/// extraction that began last asks for there is one at most, so that its budget holds; where these
/// are more than may be kept, there are none. Thread-safe.
class SparePages {
 public:
  using Sizes = std::vector<std::size_t>;  ///< of pieces

  explicit SparePages(std::size_t most_bytes) : most_bytes_(most_bytes) {}

  /// An extraction begins that will ask for these: all else goes, and is not kept from now on.
  void keep_only(int device, std::vector<Sizes> wanted);
  /// Gives back what there is, for what begins asks for none.
  void drop() { keep_only(0, {}); }
  /// Pieces of such sizes, locked, where there are some.
  std::optional<LockedPieces> take(int device, const Sizes& pieces);
  /// Keeps them when they are wanted, all locked and not there already. Never throws.
  void give(LockedPieces pieces);
  /// What is kept just now.
  std::size_t bytes();

 private:
  bool is_wanted(const LockedPieces& pieces) const;

  const std::size_t most_bytes_;
  std::mutex mutex_;
  int device_ = 0;
  std::vector<Sizes> wanted_;
  std::vector<LockedPieces> all_;  ///< has room for what is wanted
};

/// Those of the process. What they hold when it ends goes with it. A program that resets the device
/// (cudaDeviceReset) drops them before, for they are not locked any more afterwards.
SparePages& spare_pages();

}  // namespace isobrick::gpu

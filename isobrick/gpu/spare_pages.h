#pragma once

#include <cstddef>
#include <mutex>
#include <optional>
#include <vector>

#include "isobrick/gpu/locked_pieces.h"

namespace isobrick::gpu {

/// Page-locked memory that one extraction has given back, for the next one of the process: to
/// touch, lock and unlock it takes a tenth of a short extraction. Thread-safe.
class SparePages {
 public:
  /// More is not kept.
  explicit SparePages(std::size_t most_bytes) : most_bytes_(most_bytes) {}

  /// Pieces of such sizes, locked. Where there are none, what there is is of no use: it goes.
  std::optional<LockedPieces> take(int device, const std::vector<std::size_t>& pieces);
  /// Keeps them, unless there are such already or one of them is not locked.
  void give(LockedPieces pieces);
  /// Gives back what there is.
  void drop();

 private:
  const std::size_t most_bytes_;
  std::mutex mutex_;
  std::vector<LockedPieces> all_;
};

/// Those of the process. What they hold when it ends goes with it.
SparePages& spare_pages();

}  // namespace isobrick::gpu

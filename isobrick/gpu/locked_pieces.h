#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "isobrick/gpu/mapped_pages.h"

namespace isobrick::gpu {

/// Pages in pieces that the driver locks one after the other, for copies that run beside
/// everything else.
class LockedPieces {
 public:
  /// Pieces of so many bytes, none locked yet. Throws Error where there is no room.
  LockedPieces(int device, const std::vector<std::size_t>& pieces);
  LockedPieces(LockedPieces&& other) noexcept { *this = std::move(other); }
  LockedPieces& operator=(LockedPieces&& other) noexcept {
    std::swap(device_, other.device_);
    std::swap(offsets_, other.offsets_);
    std::swap(pages_, other.pages_);
    std::swap(locked_, other.locked_);
    return *this;
  }
  /// Nothing is copied from or to it any more.
  ~LockedPieces();

  std::size_t count() const { return offsets_.empty() ? 0 : offsets_.size() - 1; }
  std::byte* at(std::size_t piece) const { return pages_.data() + offsets_[piece]; }
  std::size_t bytes(std::size_t piece) const { return offsets_[piece + 1] - offsets_[piece]; }
  std::size_t bytes() const { return pages_.bytes(); }
  /// Whether they are of that device and these sizes.
  bool are(int device, const std::vector<std::size_t>& pieces) const;
  bool alike(const LockedPieces& other) const {
    return device_ == other.device_ && offsets_ == other.offsets_;
  }

  /// Locks the next piece, which has been touched. Throws Error when it cannot be.
  void lock_next();
  bool all_locked() const { return locked_ == count(); }

 private:
  int device_ = 0;
  std::vector<std::size_t> offsets_;  ///< where each piece begins, and the end; not once moved
  MappedPages pages_;
  std::size_t locked_ = 0;  ///< the first so many pieces
};

}  // namespace isobrick::gpu

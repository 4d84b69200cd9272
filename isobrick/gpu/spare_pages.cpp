#include "isobrick/gpu/spare_pages.h"

#include <algorithm>
#include <utility>

namespace isobrick::gpu {
namespace {

/// An extraction takes some 74 MiB.
constexpr std::size_t kMostBytes = std::size_t{256} << 20;

}  // namespace

std::optional<LockedPieces> SparePages::take(int device, const std::vector<std::size_t>& pieces) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(all_.begin(), all_.end(), [&](const LockedPieces& spare) {
      return spare.are(device, pieces);
    });
    if (found != all_.end()) {
      LockedPieces taken = std::move(*found);
      all_.erase(found);
      return taken;
    }
  }
  drop();
  return std::nullopt;
}

void SparePages::give(LockedPieces pieces) {
  if (!pieces.all_locked()) return;
  const std::lock_guard lock(mutex_);
  std::size_t bytes = pieces.bytes();
  for (const LockedPieces& spare : all_) {
    if (spare.alike(pieces)) return;
    bytes += spare.bytes();
  }
  if (bytes <= most_bytes_) all_.push_back(std::move(pieces));
}

void SparePages::drop() {
  std::vector<LockedPieces> dropped;  // without the lock, for the driver takes its time
  const std::lock_guard lock(mutex_);
  dropped.swap(all_);
}

SparePages& spare_pages() {
  // Never ended: the driver may have been by then.
  static SparePages& spare = *new SparePages(kMostBytes);
  return spare;
}

}  // namespace isobrick::gpu

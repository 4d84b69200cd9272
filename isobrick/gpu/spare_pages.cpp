#include "isobrick/gpu/spare_pages.h"

#include <algorithm>
#include <utility>

namespace isobrick::gpu {
namespace {

/// Of bricks of 64³ u16 an extraction takes some 74 MiB with 16 threads, and 2 MiB with each more.
constexpr std::size_t kMostBytes = std::size_t{256} << 20;

std::size_t bytes_of(const std::vector<SparePages::Sizes>& all) {
  std::size_t bytes = 0;
  for (const SparePages::Sizes& pieces : all)
    for (const std::size_t piece : pieces) bytes += MappedPages::whole_pages(piece);
  return bytes;
}

}  // namespace

void SparePages::keep_only(int device, std::vector<Sizes> wanted) {
  if (bytes_of(wanted) > most_bytes_) wanted.clear();
  std::vector<LockedPieces> others;  // go without the lock, for the driver takes its time
  others.reserve(wanted.size());
  const std::lock_guard lock(mutex_);
  device_ = device;
  wanted_ = std::move(wanted);
  others.swap(all_);
  for (LockedPieces& spare : others)
    if (is_wanted(spare)) all_.push_back(std::move(spare));
}

std::optional<LockedPieces> SparePages::take(int device, const Sizes& pieces) {
  const std::lock_guard lock(mutex_);
  const auto found = std::find_if(all_.begin(), all_.end(), [&](const LockedPieces& spare) {
    return spare.are(device, pieces);
  });
  if (found == all_.end()) return std::nullopt;
  LockedPieces taken = std::move(*found);
  all_.erase(found);
  return taken;
}

void SparePages::give(LockedPieces pieces) {
  if (!pieces.all_locked()) return;
  const std::lock_guard lock(mutex_);
  const bool there = std::any_of(all_.begin(), all_.end(),
                                 [&](const LockedPieces& spare) { return spare.alike(pieces); });
  if (!there && is_wanted(pieces)) all_.push_back(std::move(pieces));
}

std::size_t SparePages::bytes() {
  const std::lock_guard lock(mutex_);
  std::size_t bytes = 0;
  for (const LockedPieces& spare : all_) bytes += spare.bytes();
  return bytes;
}

bool SparePages::is_wanted(const LockedPieces& pieces) const {
  return std::any_of(wanted_.begin(), wanted_.end(),
                     [&](const Sizes& sizes) { return pieces.are(device_, sizes); });
}

SparePages& spare_pages() {
  // Never ended: the driver may have been by then.
  static SparePages& spare = *new SparePages(kMostBytes);
  return spare;
}

}  // namespace isobrick::gpu

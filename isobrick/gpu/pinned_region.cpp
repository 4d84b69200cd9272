#include "isobrick/gpu/pinned_region.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "isobrick/gpu/cuda_check.h"
#include "isobrick/gpu/spare_pages.h"

namespace isobrick::gpu {
namespace {

/// Touches a large page at a time on any core of the arena.
void touch(tbb::task_arena& arena, std::byte* data, std::size_t bytes) {
  constexpr std::size_t kEach = MappedPages::kLargePage;
  arena.execute([&] {
    tbb::parallel_for(std::size_t{0}, (bytes + kEach - 1) / kEach, [&](std::size_t i) {
      MappedPages::touch(data + i * kEach, std::min(kEach, bytes - i * kEach));
    });
  });
}

LockedPieces spare_or_new(int device, const std::vector<std::size_t>& pieces) {
  if (auto spare = spare_pages().take(device, pieces)) return std::move(*spare);
  return {device, pieces};
}

}  // namespace

PinnedRegion::PinnedRegion(int device, const std::vector<std::size_t>& pieces)
    : device_(device),
      threads_(tbb::this_task_arena::max_concurrency()),
      pieces_(spare_or_new(device, pieces)) {
  if (pieces_.all_locked())
    touched_ = locked_ = pieces_.count();
  else
    thread_ = std::thread([this] { run(); });
}

PinnedRegion::~PinnedRegion() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  if (thread_.joinable()) thread_.join();
  spare_pages().give(std::move(pieces_));
}

bool PinnedRegion::stopped() {
  const std::lock_guard lock(mutex_);
  return stop_;
}

void PinnedRegion::run() {
  try {
    make_current(device_);
    tbb::task_arena arena(threads_);
    for (std::size_t piece = 0; piece < pieces_.count() && !stopped(); ++piece) {
      touch(arena, pieces_.at(piece), pieces_.bytes(piece));
      advance(touched_);
      if (stopped()) return;
      pieces_.lock_next();
      advance(locked_);
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    error_ = std::current_exception();
    changed_.notify_all();
  }
}

void PinnedRegion::advance(std::size_t& count) {
  const std::lock_guard lock(mutex_);
  ++count;
  changed_.notify_all();
}

std::byte* PinnedRegion::wait_for(std::size_t piece, const std::size_t& count) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return error_ || piece < count; });
  if (piece >= count) std::rethrow_exception(error_);
  return pieces_.at(piece);
}

}  // namespace isobrick::gpu

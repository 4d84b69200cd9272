#include "isobrick/gpu/pinned_region.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "isobrick/gpu/cuda_check.h"

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

/// Where each piece begins, and the end.
std::vector<std::size_t> offsets_of(const std::vector<std::size_t>& pieces) {
  std::vector<std::size_t> offsets{0};
  for (const std::size_t bytes : pieces)
    offsets.push_back(offsets.back() + MappedPages::whole_pages(bytes));
  return offsets;
}

}  // namespace

PinnedRegion::PinnedRegion(int device, const std::vector<std::size_t>& pieces)
    : device_(device),
      threads_(tbb::this_task_arena::max_concurrency()),
      offsets_(offsets_of(pieces)),
      pages_(offsets_.back()),
      thread_([this] { run(); }) {}

PinnedRegion::~PinnedRegion() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  thread_.join();
  for (std::size_t piece = 0; piece < locked_; ++piece) (void)cudaHostUnregister(at(piece));
}

bool PinnedRegion::stopped() {
  const std::lock_guard lock(mutex_);
  return stop_;
}

void PinnedRegion::run() {
  try {
    make_current(device_);
    tbb::task_arena arena(threads_);
    for (std::size_t piece = 0; piece + 1 < offsets_.size() && !stopped(); ++piece) {
      touch(arena, at(piece), bytes(piece));
      advance(touched_);
      if (stopped()) return;
      check(cudaHostRegister(at(piece), bytes(piece), cudaHostRegisterMapped));
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
  return at(piece);
}

}  // namespace isobrick::gpu

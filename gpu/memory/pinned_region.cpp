#include "gpu/memory/pinned_region.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "gpu/memory/cuda_check.h"
#include "gpu/memory/nvtx_range.h"

namespace isobrick::inline v0::gpu {
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

std::vector<std::size_t> offsets_of(const std::vector<std::size_t>& chunks) {
  std::vector<std::size_t> offsets{0};
  for (const std::size_t bytes : chunks)
    offsets.push_back(offsets.back() + MappedPages::whole_pages(bytes));
  return offsets;
}

}  // namespace

PinnedRegion::PinnedRegion(int device, const std::vector<std::size_t>& chunks)
    : device_(device),
      threads_(tbb::this_task_arena::max_concurrency()),
      offsets_(offsets_of(chunks)),
      pages_(offsets_.back()) {
  thread_ = std::thread([this] { run(); });
}

PinnedRegion::~PinnedRegion() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  thread_.join();
  for (std::size_t chunk = 0; chunk < locked_; ++chunk) (void)cudaHostUnregister(at(chunk));
}

bool PinnedRegion::stopped() {
  const std::lock_guard lock(mutex_);
  return stop_;
}

void PinnedRegion::run() {
  try {
    make_current(device_);
    tbb::task_arena arena(threads_);
    for (std::size_t chunk = 0; chunk < count() && !stopped(); ++chunk) {
      touch(arena, at(chunk), bytes(chunk));
      advance(touched_);
      if (stopped()) return;
      const NvtxRange range("pin memory");
      check(cudaHostRegister(at(chunk), bytes(chunk), cudaHostRegisterMapped));
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

std::byte* PinnedRegion::wait_for(std::size_t chunk, const std::size_t& count) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return error_ || chunk < count; });
  if (chunk >= count) std::rethrow_exception(error_);
  return at(chunk);
}

}  // namespace isobrick::gpu

#include "isobrick/gpu/pinned_region.h"

#include <sys/mman.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>

#include "isobrick/core/error.h"
#include "isobrick/gpu/cuda_check.h"

namespace isobrick::gpu {
namespace {

constexpr std::size_t kPage = 4096, kLargePage = std::size_t{2} << 20;

/// What pages are read as at first is written, a large page at a time on any core.
void touch(std::byte* data, std::size_t bytes) {
  tbb::parallel_for(std::size_t{0}, (bytes + kLargePage - 1) / kLargePage, [&](std::size_t i) {
    const std::size_t end = std::min(bytes, (i + 1) * kLargePage);
    for (std::size_t at = i * kLargePage; at < end; at += kPage)
      *static_cast<volatile std::byte*>(data + at) = std::byte{0};
  });
}

}  // namespace

PinnedRegion::PinnedRegion(int device, const std::vector<std::size_t>& pieces) : device_(device) {
  offsets_.push_back(0);
  for (const std::size_t bytes : pieces)
    offsets_.push_back(offsets_.back() + (bytes + kPage - 1) / kPage * kPage);
  mapped_ = offsets_.back() + kLargePage;
  mapping_ = mmap(nullptr, mapped_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapping_ == MAP_FAILED) throw system_error("cannot get page-locked memory", "mmap", errno);
  const auto first = reinterpret_cast<std::uintptr_t>(mapping_);
  data_ = reinterpret_cast<std::byte*>((first + kLargePage - 1) / kLargePage * kLargePage);
  (void)madvise(data_, offsets_.back(), MADV_HUGEPAGE);
  thread_ = std::thread([this] { run(); });
}

PinnedRegion::~PinnedRegion() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  thread_.join();
  for (std::size_t piece = 0; piece < locked_; ++piece) (void)cudaHostUnregister(at(piece));
  (void)munmap(mapping_, mapped_);
}

void PinnedRegion::run() {
  try {
    make_current(device_);
    for (std::size_t piece = 0; piece + 1 < offsets_.size(); ++piece) {
      {
        const std::lock_guard lock(mutex_);
        if (stop_) return;
      }
      touch(at(piece), bytes(piece));
      advance(touched_);
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

#include "isobrick/gpu/brick_pool.h"

#include <array>
#include <chrono>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "isobrick/core/error.h"
#include "isobrick/gpu/copy_kernel.h"
#include "isobrick/gpu/device.h"
#include "isobrick/gpu/device_arena.h"
#include "isobrick/gpu/pinned_region.h"
#include "isobrick/gpu/send_books.h"
#include "isobrick/gpu/stream.h"

namespace isobrick::gpu {
namespace {

/// Copies that are asked for together: the driver lets one thread in at a time, and the bus is
/// idle between two requests.
constexpr std::size_t kGoodRequest = std::size_t{4} << 20;
/// One request of so many is timed: events with times between copies slow all of them down.
constexpr std::uint64_t kTimedOf = 16;
/// Requests that can be told apart; of older ones it is only known that they are over.
constexpr std::size_t kEvents = 16;
/// Looks whether a copy is over before whoever waits for it sleeps between them.
constexpr int kQuickLooks = 64;
constexpr std::chrono::microseconds kBetweenLooks{50};
/// What bricks are before they are sent: noticed when it is taken for samples.
constexpr int kPoison = 0xff;

}  // namespace

struct BrickPool::Impl {
  int device;
  std::size_t brick_bytes, size, used = 0;
  PinnedRegion buffers;  ///< of all threads
  DeviceArena memory;
  std::byte* bricks;
  Stream stream;
  std::size_t good_request;  ///< bricks
  bool by_kernel;            ///< are bricks copied
  SendBooks books;

  std::mutex taking;      ///< of `used`
  std::mutex requesting;  ///< of all below, but for looking at `overs`
  std::uint64_t requests = 0, bricks_sent = 0;
  struct Over : Event {
    Over() : Event(cudaEventDisableTiming) {}
  };
  std::array<Over, kEvents> overs;
  Event all_sent{cudaEventDisableTiming}, timed_begin, timed_end;
  std::uint64_t timing = 0;  ///< bricks of the request that is being timed
  double timed_seconds = 0;
  std::uint64_t timed_bricks = 0;
  std::exception_ptr failure;  ///< of a request: its bricks will never be there

  Impl(int id, std::size_t of_brick, std::size_t count, int threads)
      : device(make_current(id)),
        brick_bytes(of_brick),
        size(count * of_brick),
        buffers(id, {static_cast<std::size_t>(pinned_bytes(of_brick, threads))}),
        memory(size),
        books(threads, buffers_of_thread(of_brick)) {
    if (!memory) throw OutOfDeviceMemory("the GPU has no room for a pool of bricks");
    bricks = memory.take<std::byte>(size);
    check(cudaMemsetAsync(bricks, kPoison, size, stream.get()));
    by_kernel = brick_bytes % CopyPieces::kAlign == 0 && reads_host_memory(device);
    good_request = std::clamp<std::size_t>(kGoodRequest / of_brick, 1,
                                           std::max<std::size_t>(1, books.buffers() / 2));
  }
  /// Copies end before their buffers.
  ~Impl() { (void)cudaStreamSynchronize(stream.get()); }

  std::byte* at(std::size_t buffer) { return buffers.touched(0) + buffer * brick_bytes; }

  /// A buffer of the thread's whose brick has been copied. Copies are over soon and mostly before
  /// anybody waits, so the waiting looks again and again: an event that can be slept for costs the
  /// driver's thread a core each time, whether anybody sleeps or not.
  std::size_t free_buffer(int thread) {
    for (int looks = 0;; ++looks) {
      if (const auto buffer = books.begin(thread)) return *buffer;
      const std::size_t oldest = books.oldest(thread);
      if (books.state_of(oldest) == SendBooks::State::ended) {
        const std::lock_guard lock(requesting);
        request();
      } else if (const std::uint64_t number = books.request_of(oldest); is_over(number)) {
        books.over(number);
      } else if (looks < kQuickLooks) {
        std::this_thread::yield();
      } else {
        std::this_thread::sleep_for(kBetweenLooks);
      }
    }
  }

  /// Of a request that was made.
  bool is_over(std::uint64_t request) {
    make_current(device);
    const cudaError_t result = cudaEventQuery(overs[request % kEvents].get());
    if (result == cudaErrorNotReady) {
      (void)cudaGetLastError();  // or the next launch would report it
      return false;
    }
    check(result);
    return true;
  }

  /// Asks for the copies of what has ended; `requesting` is held.
  void request() {
    if (failure) std::rethrow_exception(failure);
    try {
      request_all();
    } catch (...) {
      failure = std::current_exception();
      throw;
    }
  }

  void request_all() {
    const std::vector<SendBooks::Piece> pieces = books.take_ended();
    if (pieces.empty()) return;
    make_current(device);
    const std::byte* const from = buffers.locked(0);
    const bool timed = requests % kTimedOf == 0;
    if (timed) {
      end_timing();
      timed_begin.record(stream);
    }
    copy_all(pieces, from);
    if (timed) {
      timed_end.record(stream);
      timing = pieces.size();
    }
    ++requests;
    overs[requests % kEvents].record(stream);
    bricks_sent += pieces.size();
    books.asked(pieces, requests);
  }

  void copy_all(const std::vector<SendBooks::Piece>& pieces, const std::byte* from) {
    CopyPieces some;
    for (const SendBooks::Piece& piece : pieces) {
      const std::byte* const buffer = from + piece.buffer * brick_bytes;
      if (!by_kernel) {
        check(cudaMemcpyAsync(piece.to, buffer, brick_bytes, cudaMemcpyHostToDevice, stream.get()));
        continue;
      }
      some.from[some.count] = buffer;
      some.to[some.count++] = piece.to;
      if (some.count < CopyPieces::kMost) continue;
      launch_copy(some, brick_bytes, stream.get());
      some.count = 0;
    }
    launch_copy(some, brick_bytes, stream.get());
  }

  void end_timing() {
    if (timing == 0) return;
    timed_end.wait();
    timed_seconds += timed_end.since(timed_begin) * 1e-3;
    timed_bricks += timing;
    timing = 0;
  }
};

BrickPool::BrickPool(int device, std::size_t brick_bytes, std::size_t bricks, int threads)
    : impl_(std::make_unique<Impl>(device, brick_bytes, bricks, threads)) {}

BrickPool::~BrickPool() = default;

std::byte* BrickPool::take(std::size_t bytes) {
  const std::lock_guard lock(impl_->taking);
  if (bytes > impl_->size - impl_->used) throw Error("the pool of bricks on the device is used up");
  std::byte* at = impl_->bricks + impl_->used;
  impl_->used += bytes;
  return at;
}

std::byte* BrickPool::begin(int thread) {
  const std::size_t buffer = impl_->free_buffer(thread);
  return impl_->at(buffer);
}

void BrickPool::end(int thread, std::byte* place) {
  if (impl_->books.end(thread, place) < impl_->good_request) return;
  // Whoever is asking the driver just now leaves it to the next one.
  const std::unique_lock lock(impl_->requesting, std::try_to_lock);
  if (lock) impl_->request();
}

void BrickPool::wait_on(const Stream& stream) {
  const std::lock_guard lock(impl_->requesting);
  impl_->request();
  impl_->all_sent.record(impl_->stream);
  check(cudaStreamWaitEvent(stream.get(), impl_->all_sent.get()));
}

double BrickPool::seconds() {
  const std::lock_guard lock(impl_->requesting);
  impl_->stream.wait();
  impl_->end_timing();
  return impl_->timed_bricks == 0 ? 0
                                  : impl_->timed_seconds * static_cast<double>(impl_->bricks_sent) /
                                        static_cast<double>(impl_->timed_bricks);
}

std::uint64_t BrickPool::bytes() const { return impl_->bricks_sent * impl_->brick_bytes; }

}  // namespace isobrick::gpu

#include "isobrick/gpu/brick_pool.h"

#include <array>
#include <atomic>
#include <exception>
#include <mutex>
#include <utility>
#include <vector>

#include "isobrick/core/error.h"
#include "isobrick/gpu/device.h"
#include "isobrick/gpu/device_arena.h"
#include "isobrick/gpu/pinned_region.h"
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
/// What bricks are before they are sent: noticed when it is taken for samples.
constexpr int kPoison = 0xff;

/// A brick's buffer.
struct Buffer {
  /// Its copy is asked for by no request yet, or it is by the one of this number, from 1.
  static constexpr std::uint64_t kEnded = ~std::uint64_t{0};
  std::uint64_t request = 0;
};

/// What a thread fills, in turn.
struct Writer {
  std::vector<Buffer> buffers;
  std::size_t next = 0;
};

/// A brick that waits to be copied.
struct Piece {
  Buffer* buffer;
  std::byte *from, *to;
};

/// Copies pieces of the same size.
void copy_all(const std::vector<Piece>& pieces, std::size_t bytes, const Stream& stream) {
#if CUDART_VERSION >= 13000
  std::vector<void*> to;
  std::vector<const void*> from;
  for (const Piece& piece : pieces) {
    to.push_back(piece.to);
    from.push_back(piece.from);
  }
  const std::vector<std::size_t> sizes(pieces.size(), bytes);
  cudaMemcpyAttributes attributes{};
  attributes.srcAccessOrder = cudaMemcpySrcAccessOrderStream;
  std::size_t of_all = 0;
  check(cudaMemcpyBatchAsync(to.data(), from.data(), sizes.data(), sizes.size(), &attributes,
                             &of_all, 1, stream.get()));
#else
  for (const Piece& piece : pieces)
    check(cudaMemcpyAsync(piece.to, piece.from, bytes, cudaMemcpyHostToDevice, stream.get()));
#endif
}

}  // namespace

struct BrickPool::Impl {
  int device;
  std::size_t brick_bytes, size, used = 0;
  PinnedRegion buffers;  ///< of all threads
  DeviceArena memory;
  std::byte* bricks;
  Stream stream;
  std::vector<Writer> writers;
  std::size_t good_request;  ///< bricks

  std::mutex mutex;  ///< of `used`, the buffers' requests and what has ended
  std::vector<Piece> ended;

  std::mutex requesting;  ///< of all below
  std::uint64_t requests = 0, bricks_sent = 0;
  struct Over : Event {
    Over() : Event(cudaEventBlockingSync | cudaEventDisableTiming) {}
  };
  std::array<Over, kEvents> overs;
  std::atomic<std::uint64_t> known_over = 0;  ///< requests of which no buffer is waited for
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
        memory(size) {
    if (!memory) throw OutOfDeviceMemory("the GPU has no room for a pool of bricks");
    bricks = memory.take<std::byte>(size);
    check(cudaMemsetAsync(bricks, kPoison, size, stream.get()));
    const std::size_t each = buffers_of_thread(of_brick);
    for (int i = 0; i < threads; ++i) writers.push_back({std::vector<Buffer>(each)});
    good_request = std::clamp<std::size_t>(kGoodRequest / of_brick, 1,
                                           std::max<std::size_t>(1, writers.size() * each / 2));
  }
  /// Copies end before their buffers.
  ~Impl() { (void)cudaStreamSynchronize(stream.get()); }

  Writer& writer(int thread) { return writers[static_cast<std::size_t>(thread)]; }
  std::size_t offset_of(int thread, std::size_t buffer) const {
    return (static_cast<std::size_t>(thread) * writers.front().buffers.size() + buffer) *
           brick_bytes;
  }
  const Event& over(std::uint64_t request) const { return overs[request % kEvents]; }

  std::uint64_t request_of(const Buffer& buffer) {
    const std::lock_guard lock(mutex);
    return buffer.request;
  }

  /// The buffer's brick has been copied.
  void wait_for(const Buffer& buffer) {
    if (request_of(buffer) == Buffer::kEnded) {
      const std::lock_guard lock(requesting);
      request();
    }
    const std::uint64_t request = request_of(buffer);
    if (request <= known_over) return;
    make_current(device);
    over(request).wait();
    std::uint64_t known = known_over;
    while (known < request && !known_over.compare_exchange_weak(known, request)) {
    }
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
    std::vector<Piece> pieces;
    {
      const std::lock_guard lock(mutex);
      pieces.swap(ended);
    }
    if (pieces.empty()) return;
    make_current(device);
    (void)buffers.locked(0);
    const bool timed = requests % kTimedOf == 0;
    if (timed) {
      end_timing();
      timed_begin.record(stream);
    }
    copy_all(pieces, brick_bytes, stream);
    if (timed) {
      timed_end.record(stream);
      timing = pieces.size();
    }
    ++requests;
    overs[requests % kEvents].record(stream);
    bricks_sent += pieces.size();
    const std::lock_guard lock(mutex);
    for (const Piece& piece : pieces) piece.buffer->request = requests;
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
  const std::lock_guard lock(impl_->mutex);
  if (bytes > impl_->size - impl_->used) throw Error("the pool of bricks on the device is used up");
  std::byte* at = impl_->bricks + impl_->used;
  impl_->used += bytes;
  return at;
}

std::byte* BrickPool::begin(int thread) {
  Writer& writer = impl_->writer(thread);
  impl_->wait_for(writer.buffers[writer.next]);
  return impl_->buffers.touched(0) + impl_->offset_of(thread, writer.next);
}

void BrickPool::end(int thread, std::byte* place) {
  Writer& writer = impl_->writer(thread);
  Buffer& buffer = writer.buffers[writer.next];
  std::byte* const from = impl_->buffers.touched(0) + impl_->offset_of(thread, writer.next);
  writer.next = (writer.next + 1) % writer.buffers.size();
  {
    const std::lock_guard lock(impl_->mutex);
    buffer.request = Buffer::kEnded;
    impl_->ended.push_back({&buffer, from, place});
    if (impl_->ended.size() < impl_->good_request) return;
  }
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

#include "isobrick/gpu/brick_pool.h"

#include <atomic>
#include <mutex>
#include <vector>

#include "isobrick/core/error.h"
#include "isobrick/gpu/stream.h"

namespace isobrick::gpu {
namespace {

/// One group of so many is timed: events with times between copies slow all of them down.
constexpr std::uint64_t kTimedOf = 16;

/// Bricks that are copied together.
struct Group {
  PinnedBuffer<std::byte> from;
  std::vector<std::byte*> places;
  Event over{cudaEventDisableTiming};
  bool under_way = false;
};

struct Writer {
  Group groups[2];
  int filled = 0;  ///< which one
};

/// Copies pieces of the same size that lie one after the other to places of their own.
void copy_to_places(const std::vector<std::byte*>& places, std::byte* from, std::size_t bytes,
                    const Stream& stream) {
#if CUDART_VERSION >= 13000
  std::vector<void*> to(places.begin(), places.end());
  std::vector<const void*> pieces;
  for (std::size_t i = 0; i < places.size(); ++i) pieces.push_back(from + i * bytes);
  const std::vector<std::size_t> sizes(places.size(), bytes);
  cudaMemcpyAttributes attributes{};
  attributes.srcAccessOrder = cudaMemcpySrcAccessOrderStream;
  std::size_t of_all = 0;
  check(cudaMemcpyBatchAsync(to.data(), pieces.data(), sizes.data(), sizes.size(), &attributes,
                             &of_all, 1, stream.get()));
#else
  for (std::size_t i = 0; i < places.size(); ++i)
    check(
        cudaMemcpyAsync(places[i], from + i * bytes, bytes, cudaMemcpyHostToDevice, stream.get()));
#endif
}

}  // namespace

struct BrickPool::Impl {
  int device;
  std::size_t brick_bytes, size, used = 0;
  Stream stream;
  DeviceBuffer<std::byte> memory;
  std::vector<std::unique_ptr<Writer>> writers;
  Event all_sent{cudaEventDisableTiming};
  std::atomic<std::uint64_t> bricks_sent = 0, groups_sent = 0;
  std::mutex mutex;  // of `used` and of what follows
  Event begun, over;
  std::uint64_t timing = 0;  ///< bricks of the group that is being timed
  double timed_seconds = 0;
  std::uint64_t timed_bricks = 0;

  Impl(int id, std::size_t of_brick, std::size_t bricks)
      : device(make_current(id)),
        brick_bytes(of_brick),
        size(bricks * of_brick),
        memory(size, stream) {
    stream.wait();
  }
  /// Copies end before their buffers.
  ~Impl() { (void)cudaStreamSynchronize(stream.get()); }

  Writer& writer(int thread) { return *writers[static_cast<std::size_t>(thread)]; }

  void copy(const Group& group) {
    copy_to_places(group.places, group.from.data(), brick_bytes, stream);
  }
  void end_timing() {
    if (timing == 0) return;
    over.wait();
    timed_seconds += over.since(begun) * 1e-3;
    timed_bricks += timing;
    timing = 0;
  }
  void copy_timed(const Group& group) {
    const std::lock_guard lock(mutex);
    end_timing();
    begun.record(stream);
    copy(group);
    over.record(stream);
    timing = group.places.size();
  }
};

BrickPool::BrickPool(int device, std::size_t brick_bytes, std::size_t bricks, int threads)
    : impl_(std::make_unique<Impl>(device, brick_bytes, bricks)) {
  for (int i = 0; i < threads; ++i) impl_->writers.push_back(std::make_unique<Writer>());
}

BrickPool::~BrickPool() = default;

std::byte* BrickPool::take(std::size_t bytes) {
  const std::lock_guard lock(impl_->mutex);
  if (bytes > impl_->size - impl_->used) throw Error("the pool of bricks on the device is used up");
  std::byte* at = impl_->memory.data() + impl_->used;
  impl_->used += bytes;
  return at;
}

std::byte* BrickPool::begin(int thread) {
  Writer& writer = impl_->writer(thread);
  Group& group = writer.groups[writer.filled];
  if (group.under_way) {
    make_current(impl_->device);
    group.over.wait();
    group.under_way = false;
  }
  if (group.from.size() == 0) {
    // Page-locking takes a while: each thread for itself.
    make_current(impl_->device);
    group.from = PinnedBuffer<std::byte>(bricks_of_group(impl_->brick_bytes) * impl_->brick_bytes);
  }
  return group.from.data() + group.places.size() * impl_->brick_bytes;
}

void BrickPool::end(int thread, std::byte* place) {
  Writer& writer = impl_->writer(thread);
  writer.groups[writer.filled].places.push_back(place);
}

void BrickPool::send(int thread) {
  Writer& writer = impl_->writer(thread);
  Group& group = writer.groups[writer.filled];
  if (group.places.empty()) return;
  make_current(impl_->device);
  if (impl_->groups_sent++ % kTimedOf == 0)
    impl_->copy_timed(group);
  else
    impl_->copy(group);
  group.over.record(impl_->stream);
  group.under_way = true;
  impl_->bricks_sent += group.places.size();
  group.places.clear();
  writer.filled = 1 - writer.filled;
}

void BrickPool::wait_on(const Stream& stream) {
  impl_->all_sent.record(impl_->stream);
  check(cudaStreamWaitEvent(stream.get(), impl_->all_sent.get()));
}

double BrickPool::seconds() {
  impl_->stream.wait();
  const std::lock_guard lock(impl_->mutex);
  impl_->end_timing();
  return impl_->timed_bricks == 0 ? 0
                                  : impl_->timed_seconds * static_cast<double>(impl_->bricks_sent) /
                                        static_cast<double>(impl_->timed_bricks);
}

std::uint64_t BrickPool::bytes() const { return impl_->bricks_sent * impl_->brick_bytes; }

}  // namespace isobrick::gpu

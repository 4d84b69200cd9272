#include "gpu/stream/brick_pool.h"

#include <atomic>
#include <chrono>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include <isobrick/device.h>
#include "gpu/memory/arena.h"
#include "gpu/memory/copy_kernel.h"
#include "gpu/memory/device_buffer.h"
#include "gpu/memory/nvtx_range.h"
#include "gpu/memory/pinned_buffer.h"
#include "gpu/memory/pinned_region.h"
#include "gpu/memory/upload_tracker.h"
#include "gpu/stream/packed_uploads.h"

namespace isobrick::inline v0::gpu {
namespace {

/// Copies that one request makes: the driver admits one thread at a time, and the bus is idle
/// between two requests.
constexpr std::size_t kRequestBytes = std::size_t{4} << 20;
/// The same for packed bricks, decoded: a device decodes few as long as many.
constexpr std::size_t kPackedRequestBytes = std::size_t{16} << 20;
/// One request of so many is timed: events that record times slow all copies down.
constexpr std::uint64_t kTimedOf = 16;
/// Polls of a copy before the waiting thread sleeps between polls.
constexpr int kBusyPolls = 64;
constexpr std::chrono::microseconds kPollInterval{50};
/// Polls until the driver is asked whether the device has failed.
constexpr int kPollsOfDriver = 200;
/// The pool is filled with this: a brick that is read before it was sent shows in the mesh.
constexpr int kPoison = 0xff;

}  // namespace

struct BrickPool::Impl {
  int device;
  Int3 grid;  ///< of bricks
  std::size_t brick_bytes, buffer_bytes;
  PinnedRegion buffers;  ///< of all threads
  DeviceBuffer<std::byte> memory;
  Stream stream;
  std::size_t bricks_of_request;  ///< bricks
  bool by_kernel;                 ///< are bricks copied
  UploadTracker uploads;
  std::optional<PackedUploads> packed;  ///< where bricks come packed

  std::mutex taking;  ///< of `bricks`
  Arena bricks;       ///< `memory`, which they fill without gaps
  PinnedBuffer<CopyReport> report{1};
  std::mutex requesting;  ///< of all below
  std::uint64_t requests = 0, bricks_sent = 0, bytes_sent = 0;
  Event all_sent{cudaEventDisableTiming}, timed_begin, timed_end;
  std::uint64_t timing = 0;  ///< bricks of the request that is being timed
  double timed_seconds = 0;
  std::uint64_t timed_bricks = 0;
  std::exception_ptr failure;  ///< of a request: its bricks will never be there

  Impl(int id, const Lattice& lattice, std::size_t count, int threads, bool is_packed)
      : device(make_current(id)),
        grid(lattice.bricks()),
        brick_bytes(lattice.brick_bytes()),
        buffer_bytes(BrickPool::buffer_bytes(lattice, is_packed)),
        buffers(id, {static_cast<std::size_t>(pinned_bytes(buffer_bytes, threads, is_packed))}),
        memory(count * brick_bytes),
        uploads(threads, buffers_of_thread(buffer_bytes, is_packed)),
        bricks(memory.data(), memory.size(), 1) {
    if (is_packed) packed.emplace(lattice, uploads.buffers());
    report[0] = {0, PackedUploads::kNoBrick};
    check(cudaMemsetAsync(memory.data(), kPoison, memory.size(), stream.get()));
    by_kernel = buffer_bytes % CopyChunks::kAlign == 0 && reads_host_memory(device);
    bricks_of_request =
        std::clamp<std::size_t>((is_packed ? kPackedRequestBytes : kRequestBytes) / brick_bytes, 1,
                                std::max<std::size_t>(1, uploads.buffers() / 2));
  }
  /// Copies end before their buffers.
  ~Impl() { (void)cudaStreamSynchronize(stream.get()); }

  /// What comes after all bricks that were requested.
  const Stream& sent() const { return packed ? packed->decoded() : stream; }
  std::byte* at(std::size_t buffer) { return buffers.touched(0) + buffer * buffer_bytes; }

  /// A buffer of the thread whose brick has been copied. Most copies complete before anybody waits,
  /// so a waiting thread polls: a blocking event costs the driver's thread a core each time,
  /// whether anybody sleeps or not.
  std::size_t free_buffer(int thread) {
    for (int polls = 0;; ++polls) {
      if (const auto buffer = uploads.begin(thread)) return *buffer;
      const std::size_t oldest = uploads.oldest(thread);
      if (uploads.state_of(oldest) == UploadTracker::State::filled) {
        const std::lock_guard lock(requesting);
        request();
      } else if (const std::uint64_t over = completed(); over >= uploads.request_of(oldest)) {
        uploads.completed(over);
      } else if (polls < kBusyPolls) {
        std::this_thread::yield();
      } else {
        if (polls % kPollsOfDriver == 0) check_device();
        std::this_thread::sleep_for(kPollInterval);
      }
    }
  }

  /// The last request that has completed.
  std::uint64_t completed() const {
    return std::atomic_ref(report[0].completed).load(std::memory_order_acquire);
  }

  /// Throws what went wrong on the device.
  void check_device() const {
    make_current(device);
    (void)sent().is_over();
  }

  /// Requests the copies of all filled buffers; `requesting` is held.
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
    const std::vector<UploadTracker::PendingBrick> filled = uploads.take_filled();
    if (filled.empty()) return;
    const NvtxRange range("upload bricks");
    make_current(device);
    const std::byte* const from = buffers.locked(0);
    const bool timed = requests % kTimedOf == 0;
    if (timed) {
      end_timing();
      timed_begin.record(stream);
    }
    copy_all(filled, from);
    if (timed) {
      timed_end.record(stream);
      timing = filled.size();
    }
    if (packed) packed->decode(filled, stream);
    ++requests;
    launch_report(report.on_device(), requests, packed ? packed->failed() : nullptr, sent().get());
    bricks_sent += filled.size();
    uploads.requested(filled, requests);
  }

  void copy_all(const std::vector<UploadTracker::PendingBrick>& filled, const std::byte* from) {
    CopyChunks some;
    for (const UploadTracker::PendingBrick& brick : filled) {
      const std::byte* const buffer = from + brick.buffer * buffer_bytes;
      const std::size_t bytes = packed ? packed->bytes(brick.buffer) : brick_bytes;
      std::byte* const to = packed ? packed->on_device(brick.buffer) : brick.to;
      bytes_sent += bytes;
      if (!by_kernel) {
        check(cudaMemcpyAsync(to, buffer, bytes, cudaMemcpyHostToDevice, stream.get()));
        continue;
      }
      some.add(buffer, to, bytes);
      if (some.count < CopyChunks::kMax) continue;
      launch_copy(some, stream.get());
      some.count = 0;
    }
    launch_copy(some, stream.get());
  }

  void end_timing() {
    if (timing == 0) return;
    timed_end.wait();
    timed_seconds += timed_end.since(timed_begin) * 1e-3;
    timed_bricks += timing;
    timing = 0;
  }
};

BrickPool::BrickPool(int device, const Lattice& lattice, std::size_t bricks, int threads,
                     bool packed)
    : impl_(std::make_unique<Impl>(device, lattice, bricks, threads, packed)) {}

BrickPool::~BrickPool() = default;

std::byte* BrickPool::take(std::size_t bytes) {
  const std::lock_guard lock(impl_->taking);
  return impl_->bricks.take<std::byte>(bytes);
}

std::byte* BrickPool::begin(int thread) {
  const std::size_t buffer = impl_->free_buffer(thread);
  return impl_->at(buffer);
}

void BrickPool::end(int thread, std::byte* place) {
  if (impl_->uploads.end(thread, place) < impl_->bricks_of_request) return;
  // A thread that is in the driver now leaves these bricks to the next request.
  const std::unique_lock lock(impl_->requesting, std::try_to_lock);
  if (lock) impl_->request();
}

void BrickPool::end_packed(int thread, std::byte* place, std::size_t bytes, Int3 brick,
                           ValueRange<double> range) {
  const std::size_t buffer = impl_->uploads.latest(thread);
  impl_->packed->set(buffer, {impl_->at(buffer), bytes}, brick, range);
  end(thread, place);
}

std::optional<Int3> BrickPool::find_damaged(bool all) {
  if (!impl_->packed) return std::nullopt;
  if (all) {
    const std::lock_guard lock(impl_->requesting);
    impl_->request();
    impl_->sent().wait();
  }
  const auto number = std::atomic_ref(impl_->report[0].failed).load(std::memory_order_relaxed);
  if (number == PackedUploads::kNoBrick) return std::nullopt;
  return point_at(static_cast<Index>(number), impl_->grid);
}

void BrickPool::wait_on(const Stream& stream) {
  const std::lock_guard lock(impl_->requesting);
  impl_->request();
  impl_->all_sent.record(impl_->sent());
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

std::uint64_t BrickPool::bytes() const { return impl_->bytes_sent; }

}  // namespace isobrick::gpu

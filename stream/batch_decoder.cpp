#include "stream/batch_decoder.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <utility>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

/// Bytes of the bricks that a thread takes at a time: small bricks come in groups.
constexpr std::size_t kJobBytes = std::size_t{128} << 10;
/// Memory that is allocated at a time.
constexpr std::size_t kPieceBytes = std::size_t{16} << 20;
/// Pieces of memory that are allocated before they are needed.
constexpr std::size_t kPiecesAhead = 3;
/// Batches that are decoded ahead in any case: one for next(), one in use.
constexpr std::size_t kBatchesAhead = 2;

}  // namespace

DecodedBatch::~DecodedBatch() { decoder_.release(*this); }

std::size_t BatchDecoder::piece_bricks(const Lattice& lattice, std::size_t capacity) {
  return std::clamp<std::size_t>(kPieceBytes / lattice.brick_bytes(), 1, capacity);
}

BatchDecoder::BatchDecoder(const StoreReader& store, int level, BatchPlanner& planner, Index reach,
                           std::size_t capacity, int threads, BrickMemory& memory)
    : reader_(store, level),
      batches_planned_(planner, reader_),
      capacity_(capacity),
      threads_count_(threads),
      bricks_of_job_(std::clamp<std::size_t>(kJobBytes / reader_.lattice().brick_bytes(), 1, 64)),
      memory_(memory),
      slots_(reader_.lattice(), reach) {
  {
    const std::lock_guard lock(mutex_);
    grow_if_short();
  }
  threads_.emplace_back([this] { plan(); });
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this, i] { work(i); });
}

BatchDecoder::~BatchDecoder() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  jobs_.stop();
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
  jobs_.clear();
  batches_.clear();
}

template <class Ready>
void BatchDecoder::wait(std::unique_lock<std::mutex>& lock, const Ready& ready) {
  changed_.wait(lock, [&] { return error_ || stop_ || ready(); });
  if (error_) std::rethrow_exception(error_);
}

std::shared_ptr<const DecodedBatch> BatchDecoder::next() {
  std::shared_ptr<const DecodedBatch> batch = next_decoded();
  check_device(batch == nullptr);
  return batch;
}

std::shared_ptr<const DecodedBatch> BatchDecoder::next_decoded() {
  Batch batch;  // an error destroys it after the lock, which its destructor takes
  std::unique_lock lock(mutex_);
  wait(lock, [&] {
    return batches_.empty() ? planned_
                            : batches_.front()->begun_ && batches_.front()->pending_ == 0;
  });
  if (batches_.empty()) return nullptr;
  batch = std::move(batches_.front());
  batches_.pop_front();
  ahead_ -= batch->bricks_->loads();
  batch->bricks_->set_decoded();
  changed_.notify_all();
  return batch;
}

std::uint64_t BatchDecoder::memory_bytes() const {
  const std::lock_guard lock(mutex_);
  return slots_.slots() * reader_.lattice().brick_bytes();
}

void BatchDecoder::plan() {
  try {
    for (TileBatch batch; next_planned(batch);) {
      // The disk reads ahead while this thread waits for room.
      hint(batch);
      begin(std::make_shared<DecodedBatch>(*this, std::move(batch)));
      const std::lock_guard lock(mutex_);
      if (stop_) return;
    }
  } catch (...) {
    return fail(std::current_exception());
  }
  jobs_.close();
  const std::lock_guard lock(mutex_);
  planned_ = true;
  changed_.notify_all();
}

/// An index is searched in parallel.
bool BatchDecoder::next_planned(TileBatch& batch) {
  tbb::task_arena arena(threads_count_);
  return arena.execute([&] { return batches_planned_.next(batch); });
}

void BatchDecoder::begin(const Batch& batch) {
  std::unique_lock lock(mutex_);
  wait(lock, [&] {
    return batches_.size() < kBatchesAhead ||
           ahead_ < memory_.bricks_ahead() * static_cast<std::size_t>(threads_count_);
  });
  if (stop_) return;
  batches_.push_back(batch);
  BatchBricks& bricks =
      batch->bricks_.emplace(slots_, batch->batch_.bricks, batch->batch_.tiles.back().tile);
  batch->pending_ = bricks.loads();
  ahead_ += bricks.loads();
  std::vector<BrickLoad> loads;
  while (bricks.missing() > 0) {
    BrickLoad next = place(bricks);
    if (!next.slot) {
      load(batch, std::exchange(loads, {}));  // these need not wait for room
      wait(lock, [&] { return (next = place(bricks)).slot != nullptr; });
      if (!next.slot) return;
    }
    loads.push_back(next);
    if (loads.size() == bricks_of_job_) load(batch, std::exchange(loads, {}));
  }
  load(batch, std::move(loads));
  batch->begun_ = true;
  changed_.notify_all();
}

void BatchDecoder::load(const Batch& batch, std::vector<BrickLoad> loads) {
  if (loads.empty()) return;
  jobs_.push(
      [this, batch, loads = std::move(loads)](int thread) { decode(thread, *batch, loads); });
}

/// The slot is null when there is no room now. Rather than wait for more memory, a brick that is
/// not needed for long is dropped.
BrickLoad BatchDecoder::place(BatchBricks& bricks) {
  grow_if_short();
  return bricks.place();
}

void BatchDecoder::hint(const TileBatch& batch) {
  if (!reader_.reads_disk() || reader_.reads_network()) return;  // hinted at already
  std::vector<Int3> missing;
  const std::lock_guard lock(mutex_);
  std::copy_if(batch.bricks.begin(), batch.bricks.end(), std::back_inserter(missing),
               [&](Int3 b) { return !slots_.contains(b); });
  jobs_.push_front([this, missing = std::move(missing)](int) { reader_.will_need(missing); });
}

/// Allocates memory before it is needed, since that takes a while.
void BatchDecoder::grow_if_short() {
  const std::size_t piece = piece_bricks(reader_.lattice(), capacity_);
  const std::size_t enough =
      std::max(kPiecesAhead * piece, static_cast<std::size_t>(threads_count_));
  while (slots_.slots() + pending_slots_ < capacity_ &&
         slots_.free_slots() + pending_slots_ < enough) {
    const std::size_t count = std::min(piece, capacity_ - slots_.slots() - pending_slots_);
    pending_slots_ += count;
    jobs_.push_front([this, count](int) { grow(count); });
  }
}

void BatchDecoder::grow(std::size_t count) {
  auto piece = memory_.room(count * reader_.lattice().brick_bytes());
  const std::lock_guard lock(mutex_);
  slots_.add_slots(std::move(piece), count);
  pending_slots_ -= count;
  changed_.notify_all();
}

void BatchDecoder::work(int thread) {
  try {
    jobs_.run(thread);
  } catch (...) {
    fail(std::current_exception());
  }
}

void BatchDecoder::decode(int thread, DecodedBatch& batch, const std::vector<BrickLoad>& loads) {
  for (const BrickLoad& load : loads) {
    if (!load_brick(thread, load)) {
      const std::lock_guard lock(mutex_);
      batch.bricks_->set_absent(load.brick);
    }
  }
  if (batch.pending_.fetch_sub(loads.size()) > loads.size()) return;
  // Under the lock, or a thread that has just read the count would miss the notification.
  const std::lock_guard lock(mutex_);
  changed_.notify_all();
}

/// False when the brick is absent.
bool BatchDecoder::load_brick(int thread, const BrickLoad& load) {
  if (!memory_.takes_packed()) {
    if (!reader_.read(load.brick, memory_.begin(thread, load.slot))) return false;
    memory_.end(thread, load.slot);
    return true;
  }
  const auto bytes = reader_.read_packed(load.brick, memory_.begin_packed(thread));
  if (!bytes) return false;
  memory_.end_packed(thread, load.slot, {load.brick, *bytes, reader_.stored_range(load.brick)});
  return true;
}

/// What the device found wrong the processor finds as well, and names.
void BatchDecoder::check_device(bool all) {
  const std::optional<Int3> brick = memory_.find_damaged(all);
  if (!brick) return;
  std::vector<std::byte> samples(reader_.lattice().brick_bytes());
  reader_.read(*brick, samples.data());
  throw Error(fmt::format("brick ({}, {}, {}): the GPU decodes other samples than the processor",
                          brick->x, brick->y, brick->z));
}

void BatchDecoder::release(DecodedBatch& batch) {
  const std::lock_guard lock(mutex_);
  batch.bricks_.reset();
  changed_.notify_all();
}

void BatchDecoder::fail(std::exception_ptr error) {
  const std::lock_guard lock(mutex_);
  if (!error_) error_ = std::move(error);
  changed_.notify_all();
}

}  // namespace isobrick

#include "stream/batch_decoder.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cassert>
#include <utility>

#include "core/morton.h"

namespace isobrick {
namespace {

/// Bricks that a thread takes at a time: small ones come in groups.
constexpr std::size_t kBytesOfJob = std::size_t{128} << 10;
/// Memory that is got at a time.
constexpr std::size_t kBytesOfSlab = std::size_t{16} << 20;
/// Pieces of it that are got before they are needed.
constexpr std::size_t kSlabsAhead = 3;
/// Batches that are decoded ahead in any case: one to take, one to work on.
constexpr std::size_t kBatchesAhead = 2;

std::uint64_t key_of(Int3 brick, Int3 grid) {
  return static_cast<std::uint64_t>(linear_index(brick, grid));
}

}  // namespace

DecodedBatch::~DecodedBatch() { decoder_.release(*this); }

const std::byte* DecodedBatch::find(Int3 brick) const {
  const auto* found = samples_.find(key_of(brick, grid_));
  assert(found);
  return *found;
}

std::size_t BatchDecoder::slab_bricks(const Lattice& lattice, std::size_t capacity) {
  return std::clamp<std::size_t>(kBytesOfSlab / lattice.brick_bytes(), 1, capacity);
}

BatchDecoder::BatchDecoder(const StoreReader& store, int level, BatchPlanner& planner, Index reach,
                           std::size_t capacity, int threads, BrickMemory& memory)
    : store_(store),
      level_(level),
      lattice_(store.info().levels[static_cast<std::size_t>(level)].lattice),
      planner_(planner),
      capacity_(capacity),
      threads_count_(threads),
      bricks_of_job_(std::clamp<std::size_t>(kBytesOfJob / lattice_.brick_bytes(), 1, 64)),
      memory_(memory),
      check_(store, level),
      slots_(lattice_, reach) {
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
  std::unique_lock lock(mutex_);
  wait(lock, [&] {
    return batches_.empty() ? planned_
                            : batches_.front()->begun_ && batches_.front()->missing_ == 0;
  });
  if (batches_.empty()) return nullptr;
  const Batch batch = std::move(batches_.front());
  batches_.pop_front();
  const std::vector<Int3>& bricks = batch->batch_.bricks;
  const std::size_t first_load = bricks.size() - batch->loads_;
  ahead_ -= batch->loads_;
  batch->samples_ = FlatMap<const std::byte*>(bricks.size());
  for (std::size_t i = 0; i < bricks.size(); ++i) {
    const std::byte* const samples = slots_.find(bricks[i]);
    if (samples && i >= first_load) slots_.count_read(bricks[i]);
    batch->samples_.insert(key_of(bricks[i], batch->grid_)).first = samples;
  }
  changed_.notify_all();
  return batch;
}

std::uint64_t BatchDecoder::memory_bytes() const {
  const std::lock_guard lock(mutex_);
  return memory_bytes_;
}

void BatchDecoder::plan() {
  try {
    for (TileBatch batch; next_planned(batch);) {
      // The disk works on what comes next, while this waits for its turn.
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
  return arena.execute([&] { return planner_.next(batch); });
}

void BatchDecoder::begin(const Batch& batch) {
  std::unique_lock lock(mutex_);
  const std::vector<Int3>& bricks = batch->batch_.bricks;
  batch->grid_ = lattice_.bricks();
  wait(lock, [&] {
    return batches_.size() < kBatchesAhead ||
           ahead_ < memory_.bricks_ahead() * static_cast<std::size_t>(threads_count_);
  });
  if (stop_) return;
  batches_.push_back(batch);
  // First what is here: it must not go as needed by nobody later, nor for what is missing.
  const auto missing =
      std::stable_partition(batch->batch_.bricks.begin(), batch->batch_.bricks.end(),
                            [&](Int3 b) { return slots_.hold(b); });
  batch->held_ = static_cast<std::size_t>(missing - batch->batch_.bricks.begin());
  slots_.advance(morton_encode(batch->batch_.tiles.back().tile) + 1);
  batch->missing_ = batch->loads_ = bricks.size() - batch->held_;
  ahead_ += batch->loads_;
  std::vector<Load> loads;
  while (batch->held_ < bricks.size()) {
    const Int3 brick = bricks[batch->held_];
    std::byte* slot = place(brick);
    if (!slot) {
      load(batch, std::exchange(loads, {}));  // nothing is to wait for this
      wait(lock, [&] { return (slot = place(brick)) != nullptr; });
      if (!slot) return;
    }
    ++batch->held_;
    loads.push_back({brick, slot});
    if (loads.size() == bricks_of_job_) load(batch, std::exchange(loads, {}));
  }
  load(batch, std::move(loads));
  batch->begun_ = true;
  changed_.notify_all();
}

void BatchDecoder::load(const Batch& batch, std::vector<Load> loads) {
  if (loads.empty()) return;
  jobs_.push(
      [this, batch, loads = std::move(loads)](int thread) { decode(thread, *batch, loads); });
}

/// Null when there is no room now. A brick that is not needed for long goes rather than that
/// more memory is waited for.
std::byte* BatchDecoder::place(Int3 brick) {
  grow_if_short();
  return slots_.place(brick);
}

void BatchDecoder::hint(const TileBatch& batch) {
  if (store_.brick_times().from_memory()) return;
  std::vector<Int3> missing;
  const std::lock_guard lock(mutex_);
  std::copy_if(batch.bricks.begin(), batch.bricks.end(), std::back_inserter(missing),
               [&](Int3 b) { return !slots_.contains(b); });
  jobs_.push_front([this, missing = std::move(missing)](int) {
    for (const Int3 b : missing) store_.will_need(level_, b);
  });
}

/// Gets more memory beforehand, for that takes a while.
void BatchDecoder::grow_if_short() {
  const std::size_t piece = slab_bricks(lattice_, capacity_);
  const std::size_t enough =
      std::max(kSlabsAhead * piece, static_cast<std::size_t>(threads_count_));
  while (slots_count_ < capacity_ && slots_.free_slots() + coming_ < enough) {
    const std::size_t count = std::min(piece, capacity_ - slots_count_);
    slots_count_ += count;
    coming_ += count;
    jobs_.push_front([this, count](int) { grow(count); });
  }
}

void BatchDecoder::grow(std::size_t count) {
  auto slab = memory_.room(count * lattice_.brick_bytes());
  const std::lock_guard lock(mutex_);
  slabs_.push_back(std::move(slab));
  slots_.add_slots(slabs_.back().get(), count);
  memory_bytes_ += count * lattice_.brick_bytes();
  coming_ -= count;
  changed_.notify_all();
}

void BatchDecoder::work(int thread) {
  try {
    jobs_.run(thread);
  } catch (...) {
    fail(std::current_exception());
  }
}

void BatchDecoder::decode(int thread, DecodedBatch& batch, const std::vector<Load>& loads) {
  for (const Load& load : loads) {
    std::byte* const to = memory_.begin(thread, load.place);
    const bool present = store_.read_brick(level_, load.brick, to);
    check_.check(load.brick, present ? to : nullptr);
    if (present) {
      memory_.end(thread, load.place);
    } else {
      const std::lock_guard lock(mutex_);
      slots_.set_absent(load.brick);
    }
  }
  if (batch.missing_.fetch_sub(loads.size()) > loads.size()) return;
  // Under the lock, or whoever has just looked would not be told.
  const std::lock_guard lock(mutex_);
  changed_.notify_all();
}

void BatchDecoder::release(const DecodedBatch& batch) {
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < batch.held_; ++i) slots_.release(batch.batch_.bricks[i]);
  changed_.notify_all();
}

void BatchDecoder::fail(std::exception_ptr error) {
  const std::lock_guard lock(mutex_);
  if (!error_) error_ = std::move(error);
  changed_.notify_all();
}

}  // namespace isobrick

#include "isobrick/stream/batch_decoder.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cassert>
#include <utility>

#include "isobrick/core/morton.h"

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
      slots_(lattice_, reach) {
  {
    const std::lock_guard lock(mutex_);
    grow_if_short();
  }
  threads_.emplace_back([this] { plan(); });
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this, i] { run(i); });
}

BatchDecoder::~BatchDecoder() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  work_.notify_all();
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
  ahead_ -= batch->loads_;
  batch->samples_ = FlatMap<const std::byte*>(batch->batch_.bricks.size());
  for (const Int3 b : batch->batch_.bricks)
    batch->samples_.insert(key_of(b, batch->grid_)).first = slots_.find(b);
  changed_.notify_all();
  return batch;
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
      load(batch, loads);  // nothing is to wait for this
      wait(lock, [&] { return (slot = place(brick)) != nullptr; });
      if (!slot) return;
    }
    ++batch->held_;
    loads.push_back({brick, slot});
    if (loads.size() == bricks_of_job_) load(batch, loads);
  }
  load(batch, loads);
  batch->begun_ = true;
  changed_.notify_all();
}

void BatchDecoder::load(const Batch& batch, std::vector<Load>& loads) {
  if (loads.empty()) return;
  jobs_.push_back(
      [this, batch, mine = std::exchange(loads, {})](int thread) { decode(thread, batch, mine); });
  work_.notify_one();
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
  work_.notify_one();
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
    work_.notify_one();
  }
}

void BatchDecoder::grow(std::size_t count) {
  auto slab = memory_.room(count * lattice_.brick_bytes());
  const std::lock_guard lock(mutex_);
  slots_.add_slots(slab.get(), count);
  slabs_.push_back(std::move(slab));
  memory_bytes_ += count * lattice_.brick_bytes();
  coming_ -= count;
  changed_.notify_all();
}

void BatchDecoder::run(int thread) {
  try {
    for (;;) {
      Job job;
      {
        std::unique_lock lock(mutex_);
        work_.wait(lock, [&] { return stop_ || !jobs_.empty(); });
        if (stop_) return;
        job = std::move(jobs_.front());
        jobs_.pop_front();
      }
      job(thread);
    }
  } catch (...) {
    fail(std::current_exception());
  }
}

void BatchDecoder::decode(int thread, const Batch& batch, const std::vector<Load>& loads) {
  std::vector<char> present;
  for (const Load& load : loads) {
    std::byte* to = memory_.begin(thread, load.samples);
    present.push_back(store_.read_brick(level_, load.brick, to));
    if (present.back()) memory_.end(thread, load.samples);
  }
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < loads.size(); ++i) slots_.decoded(loads[i].brick, present[i] != 0);
  batch->missing_ -= loads.size();
  if (batch->missing_ == 0) changed_.notify_all();
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

#include "stream/resident_bricks.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <isobrick/error.h>
#include "core/stopwatch.h"

namespace isobrick::inline v0 {
namespace {

/// How often a thread that waits for another's brick checks whether it was cancelled.
constexpr std::chrono::milliseconds kPollInterval{5};

/// The part of the budget for bricks that are read together, and for those that are prefetched.
/// More of them would displace one another.
constexpr std::uint64_t kPartTogether = 8;

/// Of a budget: what ranges take.
std::uint64_t range_bytes(std::uint64_t budget) {
  return std::min(budget / 16, std::uint64_t{32} << 20);
}

}  // namespace

std::size_t ResidentBricks::KeyHash::operator()(const Key& k) const {
  auto h = static_cast<std::uint64_t>(k.level);
  for (int axis = 0; axis < 3; ++axis) {
    h = (h ^ static_cast<std::uint64_t>(k.brick[axis])) * 0x9e3779b97f4a7c15ULL;
    h ^= h >> 29;
  }
  return static_cast<std::size_t>(h);
}

ResidentBricks::ResidentBricks(std::shared_ptr<const BrickSource> source, std::uint64_t budget)
    : source_(std::move(source)),
      ranges_(source_, range_bytes(budget)),
      budget_(budget - range_bytes(budget)),
      resident_(source_->info()) {}

/// Drops unused bricks until so many bytes fit, as far as possible.
void ResidentBricks::make_room(std::uint64_t bytes) {
  for (auto at = order_.end(); at != order_.begin() && counters_.bytes + bytes > budget_;) {
    --at;
    const auto found = entries_.find(*at);
    if (found->second.samples && found->second.samples.use_count() > 1) continue;
    if (found->second.samples) {
      counters_.bytes -= found->second.samples->size();
      --counters_.bricks;
    }
    resident_.erase(at->level, at->brick);
    entries_.erase(found);
    at = order_.erase(at);
  }
}

std::shared_ptr<const BrickSamples> ResidentBricks::load(const Key& key) {
  const Lattice& lattice = source_->info().levels[static_cast<std::size_t>(key.level)].lattice;
  auto samples = std::make_shared<BrickSamples>(lattice.brick_bytes());
  if (!source_->read_brick(key.level, key.brick, samples->data())) {
    samples->clear();
  }
  return samples;
}

std::shared_ptr<const BrickSamples> ResidentBricks::get(int level, Int3 brick,
                                                        const CancellationToken& token) {
  return get({level, brick}, token, true);
}

std::shared_ptr<const BrickSamples> ResidentBricks::get_unless_busy(
    int level, Int3 brick, const CancellationToken& token) {
  return get({level, brick}, token, false);
}

std::shared_ptr<const BrickSamples> ResidentBricks::get(const Key& key,
                                                        const CancellationToken& token,
                                                        bool may_wait) {
  std::unique_lock lock(mutex_);
  for (;;) {
    token.check();
    const auto found = entries_.find(key);
    if (found == entries_.end()) break;
    Entry& entry = found->second;
    if (!entry.loading) {
      order_.splice(order_.begin(), order_, entry.order);
      if (entry.failure) std::rethrow_exception(entry.failure);
      return entry.samples;
    }
    if (!may_wait) return nullptr;
    loaded_.wait_for(lock, kPollInterval);
  }
  LoadResult made = read(key, lock);
  if (made.failure) std::rethrow_exception(made.failure);
  return std::move(made.samples);
}

std::uint64_t ResidentBricks::brick_bytes(int level) const {
  return source_->info().levels[static_cast<std::size_t>(level)].lattice.brick_bytes();
}

/// The next brick that no thread reads, of the oldest request with such a brick; else the front of
/// the prefetch queue.
std::optional<ResidentBricks::Key> ResidentBricks::next_to_read() {
  for (Request& request : requests_)
    while (request.next < request.bricks.size()) {
      const Key key{request.level, request.bricks[request.next++]};
      if (!entries_.contains(key)) return key;
    }
  if (prefetch_queue_.empty()) return std::nullopt;
  // What is in use fills the budget at times: then it would be read to be dropped at once.
  const std::uint64_t bytes = brick_bytes(prefetch_queue_.front().level);
  make_room(bytes);
  if (counters_.bytes + bytes > budget_) return std::nullopt;
  return prefetch_queue_.front();
}

/// Removes a brick from the prefetch queue.
void ResidentBricks::forget_need(const Key& key) {
  const auto found = prefetch_places_.find(key);
  if (found == prefetch_places_.end()) return;
  prefetch_queue_.erase(found->second);
  prefetch_places_.erase(found);
  prefetch_bytes_ -= brick_bytes(key.level);
}

bool ResidentBricks::over(const Request& request) const {
  return request.next == request.bricks.size() &&
         std::none_of(request.bricks.begin(), request.bricks.end(), [&](Int3 b) {
           const auto found = entries_.find({request.level, b});
           return found != entries_.end() && found->second.loading;
         });
}

void ResidentBricks::read_together(int level, std::span<const Int3> bricks,
                                   const CancellationToken& token) {
  const std::uint64_t bytes = brick_bytes(level);
  std::unique_lock lock(mutex_);
  const auto missing =
      static_cast<std::uint64_t>(std::count_if(bricks.begin(), bricks.end(), [&](Int3 b) {
        return !is_resident({level, b});
      }));
  if (missing < 2 || missing * bytes > budget_ / kPartTogether) return;
  const auto own = requests_.insert(requests_.end(), {level, bricks});
  try {
    while (!over(*own)) {
      token.check();
      if (const auto key = next_to_read())
        (void)read(*key, lock);
      else
        loaded_.wait_for(lock, kPollInterval);
    }
  } catch (...) {
    requests_.erase(own);
    throw;
  }
  requests_.erase(own);
}

/// Reads a missing brick that no other thread reads. Releases the lock meanwhile.
ResidentBricks::LoadResult ResidentBricks::read(const Key& key,
                                                std::unique_lock<std::mutex>& lock) {
  entries_[key];
  forget_need(key);
  const std::uint64_t bytes = brick_bytes(key.level);
  make_room(bytes);
  // Counted before it is there: threads that load at once must not all find room.
  counters_.bytes += bytes;
  counters_.peak_bytes = std::max(counters_.peak_bytes, counters_.bytes);
  lock.unlock();
  LoadResult made;
  Stopwatch watch;
  try {
    made.samples = load(key);
  } catch (...) {
    made.failure = std::current_exception();
  }
  lock.lock();
  counters_.read_seconds += watch.lap();
  ++counters_.reads;
  counters_.bytes -= bytes;
  if (made.samples) {
    counters_.bytes += made.samples->size();
    ++counters_.bricks;
  }
  Entry& entry = entries_[key];
  entry.loading = false;
  resident_.insert(key.level, key.brick);
  entry.samples = made.samples;
  entry.failure = made.failure;
  order_.push_front(key);
  entry.order = order_.begin();
  loaded_.notify_all();
  if (counters_.bytes > budget_) make_room(0);
  return made;
}

std::shared_ptr<const BrickSamples> ResidentBricks::find(int level, Int3 brick) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find({level, brick});
  if (found == entries_.end() || found->second.loading) return nullptr;
  return found->second.samples;
}

bool ResidentBricks::resident(int level, Box3 box) const {
  for (Index z = box.lo.z; z < box.hi.z; ++z)
    for (Index y = box.lo.y; y < box.hi.y; ++y)
      for (Index x = box.lo.x; x < box.hi.x; ++x)
        if (!is_resident({level, {x, y, z}})) return false;
  return true;
}

bool ResidentBricks::half_resident(int level, Box3 bricks) const {
  const Index all = volume(bricks.extent());
  Index found = 0, missing = 0;
  for (Index z = bricks.lo.z; z < bricks.hi.z; ++z)
    for (Index y = bricks.lo.y; y < bricks.hi.y; ++y)
      for (Index x = bricks.lo.x; x < bricks.hi.x; ++x) {
        ++(is_resident({level, {x, y, z}}) ? found : missing);
        if (2 * found >= all) return true;
        if (2 * missing > all) return false;
      }
  return true;
}

void ResidentBricks::close() {
  ranges_.clear();
  forget_needs();
  const std::lock_guard lock(mutex_);
  budget_ = 0;
  make_room(0);
}

bool ResidentBricks::half_resident(int level, std::span<const Int3> bricks) const {
  std::size_t found = 0;
  for (const Int3 b : bricks) found += is_resident({level, b});
  return 2 * found >= bricks.size();
}

void ResidentBricks::will_need(int level, Int3 brick) {
  {
    const std::lock_guard lock(mutex_);
    const Key key{level, brick};
    if (entries_.contains(key) || prefetch_places_.contains(key)) return;
    const std::uint64_t bytes = brick_bytes(level), most = budget_ / kPartTogether;
    if (bytes <= most) {
      while (prefetch_bytes_ + bytes > most) forget_need(Key(prefetch_queue_.front()));
      prefetch_places_.emplace(key, prefetch_queue_.insert(prefetch_queue_.end(), key));
      prefetch_bytes_ += bytes;
    }
  }
  source_->will_need(level, brick);
}

void ResidentBricks::forget_needs() {
  const std::lock_guard lock(mutex_);
  prefetch_queue_.clear();
  prefetch_places_.clear();
  prefetch_bytes_ = 0;
}

ResidentBricks::Counters ResidentBricks::counters() const {
  const std::lock_guard lock(mutex_);
  return counters_;
}

}  // namespace isobrick

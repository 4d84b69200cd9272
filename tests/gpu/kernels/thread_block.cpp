#include "tests/gpu/kernels/thread_block.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <thread>

#include "tests/gpu/kernels/fiber.h"
#include "tests/gpu/kernels/shared_bytes.h"

namespace isobrick::inline v0::gpu {

thread_local unsigned char shared_bytes[emulated::kMaxSharedBytes] __attribute__((aligned(256)));

}  // namespace isobrick::gpu

namespace isobrick::emulated {
namespace {

/// As many as ThreadSanitizer can distinguish.
constexpr unsigned kMaxThreads = 7000;

thread_local ThreadBlock* current_block = nullptr;

const char* name_of(ThreadBlock::Together what) {
  constexpr const char* names[] = {"__syncwarp", "a shuffle", "a vote", "a reduction"};
  return names[static_cast<int>(what)];
}

}  // namespace

ThreadBlock::ThreadBlock(unsigned index, unsigned blocks, unsigned threads, unsigned seed)
    : index_(index),
      blocks_(blocks),
      random_(seed * 977 + index + 1),
      fibers_(threads),
      caller_(std::make_unique<Fiber>()),
      warps_((threads + 31) / 32),
      round_of_(threads),
      copies_(threads),
      last_load_(threads),
      has_fence_(threads) {}

ThreadBlock::~ThreadBlock() = default;

ThreadBlock& ThreadBlock::current() { return *current_block; }

void ThreadBlock::run(const std::function<void()>& kernel) {
  // Nothing grows later, which ThreadSanitizer would see.
  paused_.reserve(fibers_.size());
  favoured_.resize(warps_.size());
  std::iota(favoured_.begin(), favoured_.end(), 0u);
  std::ranges::shuffle(favoured_, random_);
  for (Warp& warp : warps_) warp.ready.reserve(32);
  kernel_ = &kernel;
  current_block = this;
  for (unsigned i = 0; i < fibers_.size(); ++i) {
    fibers_[i] = std::make_unique<Fiber>([] { current_block->begin_thread(); });
    make_ready(i);
  }
  running_ = choose_next();
  release(this);
  caller_->switch_to(*fibers_[running_]);
  acquire(&filled_);
  current_block = nullptr;
}

void ThreadBlock::begin_thread() {
  fibers_[running_]->arrive();
  acquire(this);
  (*kernel_)();
  release(&filled_);
  Fiber& own = *fibers_[running_];
  own.end_in(++filled_ < fibers_.size() ? *fibers_[running_ = choose_next()] : *caller_);
}

void ThreadBlock::go_on_elsewhere() {
  Fiber& own = *fibers_[running_];
  const unsigned next = choose_next();
  if (next == running_) return;
  running_ = next;
  own.switch_to(*fibers_[next]);
}

unsigned ThreadBlock::choose_next() {
  const auto take = [&](std::vector<unsigned>& threads) {
    std::swap(threads[random_() % threads.size()], threads.back());
    const unsigned thread = threads.back();
    threads.pop_back();
    return thread;
  };
  const auto first =
      std::ranges::find_if(favoured_, [&](unsigned warp) { return !warps_[warp].ready.empty(); });
  if (first == favoured_.end()) {
    if (paused_.empty()) fail("its threads wait for each other");
    return take(paused_);
  }
  // What paused threads look at is seldom there yet.
  if (!paused_.empty() && random_() % 16 == 0) return take(paused_);
  const unsigned warp = *first;
  if (random_() % 256 == 0) std::iter_swap(first, favoured_.end() - 1);
  return take(warps_[warp].ready);
}

void ThreadBlock::make_ready(unsigned thread) { warps_[thread / 32].ready.push_back(thread); }

void ThreadBlock::pause() {
  // Those that are left may wait for another block, or for the host.
  if (std::ranges::all_of(warps_, [](const Warp& warp) { return warp.ready.empty(); }))
    std::this_thread::yield();
  paused_.push_back(running_);
  go_on_elsewhere();
}

void ThreadBlock::wait_for_block() {
  // Of two that take turns: who is late sees nothing of what comes after the next barrier.
  const void* const barrier = &barriers_[barrier_];
  has_fence_[running_] = false;
  release(barrier);
  if (++in_barrier_ == fibers_.size()) {
    in_barrier_ = 0;
    barrier_ ^= 1;
    for (unsigned i = 0; i < fibers_.size(); ++i) make_ready(i);
  }
  go_on_elsewhere();
  acquire(barrier);
}

const std::uint64_t* ThreadBlock::exchange_words(Together what, std::uint64_t own) {
  const unsigned warp = running_ / 32, lane = running_ % 32;
  Round& round = warps_[warp].rounds[round_of_[running_]];
  round_of_[running_] ^= 1;
  if (round.arrived == 0) round.what = what;
  if (round.what != what) {
    std::fprintf(stderr, "warp %u: %s and %s at a time\n", warp, name_of(round.what),
                 name_of(what));
    fail("threads of a warp have parted");
  }
  round.values[lane] = own;
  // The others let threads agree on values, but not on memory.
  if (what == Together::warp) release(&round);
  if (++round.arrived == 32) {
    round.arrived = 0;
    for (unsigned i = 0; i < 32; ++i) make_ready(32 * warp + i);
  }
  go_on_elsewhere();
  if (what == Together::warp) acquire(&round);
  return round.values;
}

void ThreadBlock::fail(const char* what) const {
  std::fprintf(stderr, "block %u, thread %u: %s\n", index_, running_, what);
  std::abort();
}

void ThreadBlock::note_load(const void* word) { last_load_[running_] = word; }
void ThreadBlock::note_store(const void* word) {
  if (has_fence_[running_]) release(word);
}
void ThreadBlock::fence() {
  has_fence_[running_] = true;
  acquire(last_load_[running_]);
}

void release([[maybe_unused]] const void* what) {
#if defined(ISOBRICK_TSAN)
  __tsan_release(const_cast<void*>(what));
#endif
}
void acquire([[maybe_unused]] const void* what) {
#if defined(ISOBRICK_TSAN)
  __tsan_acquire(const_cast<void*>(what));
#endif
}

void launch(unsigned blocks, unsigned threads, std::size_t shared_bytes, unsigned seed,
            const std::function<void()>& kernel) {
  // As a device of so many multiprocessors: a block begins when those before it have.
  const unsigned most = std::max(1u, kMaxThreads / threads);
  std::atomic<unsigned> next{0};
  std::vector<std::jthread> running;
  for (unsigned i = 0; i < std::min(blocks, most); ++i)
    running.emplace_back([&] {
      const SharedBytes bytes(shared_bytes);
      for (unsigned block; (block = next++) < blocks;)
        ThreadBlock(block, blocks, threads, seed).run(kernel);
    });
}

}  // namespace isobrick::emulated

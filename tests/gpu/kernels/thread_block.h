#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <random>
#include <utility>
#include <vector>

namespace isobrick::emulated {

class Fiber;

/// One block of a kernel's threads, all on the thread of the CPU that calls run(). They take turns:
/// one runs until it waits for others, and chance chooses the next. Some warps are favoured for a
/// while and run ahead as far as they can, so that a missing barrier shows (Burckhardt
/// et al., A randomized scheduler with probabilistic guarantees of finding bugs, 2010).
/// A call that all threads of a warp, or of the block, must make and some don't ends the program
/// with a line about it.
class ThreadBlock {
 public:
  /// What a thread of a warp waits for the others with.
  enum class Together { warp, shuffle, vote, reduce };

  ThreadBlock(unsigned index, unsigned blocks, unsigned threads, unsigned seed);
  ~ThreadBlock();
  ThreadBlock(const ThreadBlock&) = delete;
  ThreadBlock& operator=(const ThreadBlock&) = delete;

  /// Calls `kernel` as each of the threads.
  void run(const std::function<void()>& kernel);

  /// That of the calling thread.
  static ThreadBlock& current();

  unsigned index() const { return index_; }
  unsigned blocks() const { return blocks_; }
  unsigned thread() const { return running_; }

  /// Where to and from: what the thread has begun to copy, 16 bytes each.
  std::vector<std::pair<void*, const void*>>& copies() { return copies_[running_]; }

  /// Others go on first.
  void pause();
  /// Fences: a thread's last load before one acquires, its stores between one and the block's next
  /// barrier release.
  void note_load(const void* word);
  void note_store(const void* word);
  void fence();
  void wait_for_block();
  /// Gives each thread of the warp the values of all, until it gives its next but one.
  template <class T>
  std::array<T, 32> exchange(Together what, T value) {
    static_assert(sizeof(T) <= sizeof(std::uint64_t));
    std::uint64_t own = 0;
    std::memcpy(&own, &value, sizeof value);
    const std::uint64_t* all = exchange_words(what, own);
    std::array<T, 32> values;
    for (std::size_t i = 0; i < 32; ++i) std::memcpy(&values[i], all + i, sizeof(T));
    return values;
  }

 private:
  struct Round {
    std::uint64_t values[32];
    unsigned arrived = 0;
    Together what{};
  };
  struct Warp {
    Round rounds[2];  ///< a thread may begin the next one while others still read this one's
    std::vector<unsigned> ready;  ///< its threads that need not wait
  };

  const std::uint64_t* exchange_words(Together what, std::uint64_t own);
  void begin_thread();
  void go_on_elsewhere();
  unsigned choose_next();
  void make_ready(unsigned thread);
  [[noreturn]] void fail(const char* what) const;

  unsigned index_, blocks_, running_ = 0, filled_ = 0;
  unsigned in_barrier_ = 0, barrier_ = 0;  ///< threads that have arrived; at which of two
  std::uint64_t barriers_[2] = {};         ///< for ThreadSanitizer
  std::minstd_rand random_;
  const std::function<void()>* kernel_ = nullptr;
  std::vector<std::unique_ptr<Fiber>> fibers_;
  std::unique_ptr<Fiber> caller_;
  std::vector<Warp> warps_;
  std::vector<std::uint8_t> round_of_;  ///< of each thread
  std::vector<unsigned> paused_;        ///< threads that look at something again and again
  std::vector<unsigned> favoured_;      ///< warps; the first goes on whenever it can
  std::vector<std::vector<std::pair<void*, const void*>>> copies_;
  std::vector<const void*> last_load_;
  std::vector<std::uint8_t> has_fence_;
};

/// For ThreadSanitizer: whoever acquires sees what was written before by who has released.
void release(const void* what);
void acquire(const void* what);

/// Runs a kernel of so many blocks, several at a time, begun in their order.
void launch(unsigned blocks, unsigned threads, std::size_t shared_bytes, unsigned seed,
            const std::function<void()>& kernel);

}  // namespace isobrick::emulated

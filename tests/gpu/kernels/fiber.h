#pragma once

#include <setjmp.h>
#include <ucontext.h>

#include <cstddef>
#include <memory>
#include <utility>

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/common_interface_defs.h>
#elif defined(ISOBRICK_TSAN)
#include <sanitizer/tsan_interface.h>
#endif

namespace isobrick::on_cpu {

/// A thread of a kernel: a stack and where on it it goes on. Sanitizers are told of the switch;
/// to ThreadSanitizer it is none after which one sees what the other has written.
class Fiber {
 public:
  /// The one that runs already.
  Fiber() {
#if defined(ISOBRICK_TSAN)
    tsan_ = __tsan_get_current_fiber();
#endif
  }
  /// One that begins with `entry`, which must not return.
  explicit Fiber(void (*entry)()) : stack_(std::make_unique_for_overwrite<std::byte[]>(kStack)) {
    getcontext(&context_);
    context_.uc_stack.ss_sp = stack_.get();
    context_.uc_stack.ss_size = kStack;
    context_.uc_link = nullptr;
    bottom_ = stack_.get();
    size_ = kStack;
    makecontext(&context_, entry, 0);
    begun_ = false;
#if defined(ISOBRICK_TSAN)
    tsan_ = __tsan_create_fiber(0);
#endif
  }
  ~Fiber() {
#if defined(ISOBRICK_TSAN)
    if (stack_) __tsan_destroy_fiber(tsan_);
#endif
  }
  Fiber(const Fiber&) = delete;
  Fiber& operator=(const Fiber&) = delete;

  /// From the running one.
  void switch_to(Fiber& other) {
#if defined(__SANITIZE_ADDRESS__)
    left = this;
    __sanitizer_start_switch_fiber(&fake_stack_, other.bottom_, other.size_);
#elif defined(ISOBRICK_TSAN)
    __tsan_switch_to_fiber(other.tsan_, __tsan_switch_to_fiber_no_sync);
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(ISOBRICK_TSAN)
    swapcontext(&context_, &other.context_);
#else
    // swapcontext asks the system twice for the mask of signals, which is the same for all.
    if (_setjmp(place_) == 0) {
      if (std::exchange(other.begun_, true)) _longjmp(other.place_, 1);
      setcontext(&other.context_);
    }
#endif
    arrive();
  }
  /// The first that a new one does.
  void arrive() {
#if defined(__SANITIZE_ADDRESS__)
    __sanitizer_finish_switch_fiber(fake_stack_, &left->bottom_, &left->size_);
#endif
  }

 private:
#if defined(__SANITIZE_ADDRESS__)
  static constexpr std::size_t kStack = std::size_t{256} << 10;
#else
  static constexpr std::size_t kStack = std::size_t{64} << 10;
#endif
  std::unique_ptr<std::byte[]> stack_;
  ucontext_t context_;
  jmp_buf place_;
  bool begun_ = true;
  // For the sanitizers.
  const void* bottom_ = nullptr;
  std::size_t size_ = 0;
  void* fake_stack_ = nullptr;
  void* tsan_ = nullptr;
  inline static thread_local Fiber* left = nullptr;
};

}  // namespace isobrick::on_cpu

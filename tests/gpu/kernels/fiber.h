#pragma once

#include <setjmp.h>
#include <ucontext.h>

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <utility>

#if defined(ISOBRICK_ASAN)
#include <sanitizer/common_interface_defs.h>
#elif defined(ISOBRICK_TSAN)
#include <sanitizer/tsan_interface.h>
#endif

namespace isobrick::emulated {

/// A thread of a kernel: a stack and where on it it goes on. Sanitizers are notified of the switch;
/// for ThreadSanitizer it orders nothing.
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
    context_.uc_stack = {};  // AddressSanitizer would forget all about it at each switch
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
    tell_of(other, &fake_stack_);
#if defined(ISOBRICK_ASAN) || defined(ISOBRICK_TSAN)
    swapcontext(&context_, &other.context_);
#else
    // swapcontext makes two system calls for the mask of signals, which is the same for all.
    if (_setjmp(place_) == 0) other.go_on();
#endif
    arrive();
  }
  /// From the running one, which does not go on.
  [[noreturn]] void end_in(Fiber& other) {
    tell_of(other, nullptr);
    other.go_on();
  }
  /// The first that a new one does.
  void arrive() {
#if defined(ISOBRICK_ASAN)
    __sanitizer_finish_switch_fiber(fake_stack_, &left->bottom_, &left->size_);
#endif
  }

 private:
  void tell_of([[maybe_unused]] Fiber& other, [[maybe_unused]] void** fake_stack) {
#if defined(ISOBRICK_ASAN)
    left = this;
    __sanitizer_start_switch_fiber(fake_stack, other.bottom_, other.size_);
#elif defined(ISOBRICK_TSAN)
    __tsan_switch_to_fiber(other.tsan_, __tsan_switch_to_fiber_no_sync);
#endif
  }
  [[noreturn]] void go_on() {
#if !defined(ISOBRICK_ASAN) && !defined(ISOBRICK_TSAN)
    if (std::exchange(begun_, true)) _longjmp(place_, 1);
#endif
    setcontext(&context_);
    std::abort();
  }

#if defined(ISOBRICK_ASAN)
  static constexpr std::size_t kStack = std::size_t{256} << 10;
#else
  static constexpr std::size_t kStack = std::size_t{64} << 10;
#endif
  std::unique_ptr<std::byte[]> stack_;
  ucontext_t context_;
  jmp_buf place_;
  bool begun_ = true;
  // For the sanitizers.
  [[maybe_unused]] const void* bottom_ = nullptr;
  [[maybe_unused]] std::size_t size_ = 0;
  [[maybe_unused]] void* fake_stack_ = nullptr;
  [[maybe_unused]] void* tsan_ = nullptr;
  inline static thread_local Fiber* left = nullptr;
};

}  // namespace isobrick::emulated

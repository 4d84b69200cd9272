#pragma once

#include <atomic>

// How a signal reaches code that waits for input and cannot report progress.
namespace isobrick::inline v0 {
namespace detail {
inline std::atomic<bool> cancel_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "signal handlers need that");
}  // namespace detail

/// From now on a wait for standard input throws Cancelled. For signal handlers.
inline void request_cancel() noexcept { detail::cancel_requested.store(true); }
inline bool cancel_requested() noexcept { return detail::cancel_requested.load(); }

}  // namespace isobrick

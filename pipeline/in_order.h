#pragma once

#include <tbb/parallel_pipeline.h>

#include <cstddef>
#include <vector>

namespace isobrick::inline v0 {

/// Takes things one after the other, works on them with all threads, and delivers them in the
/// order in which they were taken; at most `in_flight` (at least 1) are under way. This
/// function owns them: TBB does not free the items between its filters when one of them throws.
///
///     bool take(T&)      fills a new thing in; false: there are no more. One call at a time.
///     void work(T&)      on any thread, several at a time
///     void deliver(T&)   one call at a time
template <class T, class Take, class Work, class Deliver>
void run_in_order(std::size_t in_flight, Take&& take, Work&& work, Deliver&& deliver) {
  std::vector<T> slots(in_flight);
  std::size_t taken = 0;
  const auto begin = [&](tbb::flow_control& flow) -> T* {
    // Delivered in order, so the earlier user of this slot is done.
    T& slot = slots[taken++ % in_flight];
    if (take(slot)) return &slot;
    flow.stop();
    return nullptr;
  };
  const auto go_on = [&](T* slot) {
    work(*slot);
    return slot;
  };
  const auto end = [&](T* slot) {
    deliver(*slot);
    *slot = T{};
  };
  using tbb::filter_mode;
  tbb::parallel_pipeline(in_flight,
                         tbb::make_filter<void, T*>(filter_mode::serial_in_order, begin) &
                             tbb::make_filter<T*, T*>(filter_mode::parallel, go_on) &
                             tbb::make_filter<T*, void>(filter_mode::serial_in_order, end));
}

}  // namespace isobrick

#pragma once

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <utility>

namespace isobrick::inline v0 {

/// Exactly so many threads for the work of one command, also when that is more
/// than there are cores; 0 means one a core.
class Workers {
 public:
  explicit Workers(int threads)
      : threads_(threads > 0 ? threads : tbb::info::default_concurrency()),
        control_(tbb::global_control::max_allowed_parallelism,
                 static_cast<std::size_t>(std::max(threads_, tbb::info::default_concurrency()))),
        arena_(threads_) {}

  int threads() const { return threads_; }
  template <class F>
  decltype(auto) execute(F&& f) {
    return arena_.execute(std::forward<F>(f));
  }

 private:
  int threads_;
  tbb::global_control control_;
  tbb::task_arena arena_;
};

}  // namespace isobrick

#include "python/src/interruptible.h"

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <isobrick/error.h>

namespace isobrick::python {
namespace {

constexpr std::chrono::milliseconds kPatience{100};

/// What was done of a stage.
struct StageState {
  std::string name;
  std::uint64_t done = 0, total = 0;
};

/// Collects what the operation reports until the calling thread takes it.
class CollectedProgress final : public Progress {
 public:
  explicit CollectedProgress(std::stop_token cancel) : cancel_(std::move(cancel)) {}

  void begin(std::string_view stage, std::uint64_t total) override {
    check();
    const std::lock_guard lock(mutex_);
    current_ = {std::string(stage), 0, total};
    changed_ = true;
  }
  void advance(std::uint64_t done) override {
    check();
    const std::lock_guard lock(mutex_);
    current_.done += done;
    changed_ = true;
  }
  void end() override {
    check();
    const std::lock_guard lock(mutex_);
    if (std::exchange(changed_, false)) ended_.push_back(current_);
  }

  /// What has changed since it was taken last.
  std::vector<StageState> take() {
    const std::lock_guard lock(mutex_);
    std::vector<StageState> states = std::exchange(ended_, {});
    if (std::exchange(changed_, false)) states.push_back(current_);
    return states;
  }

 private:
  void check() const {
    if (cancel_.stop_requested()) throw Cancelled("the operation was cancelled");
  }

  std::stop_token cancel_;
  std::mutex mutex_;
  StageState current_;
  std::vector<StageState> ended_;  ///< stages that ended since they were taken
  bool changed_ = false;           ///< whether the current stage is to be taken
};

void report(const py::object& callback, CollectedProgress& progress) {
  if (callback.is_none()) return;
  for (const StageState& state : progress.take()) callback(state.name, state.done, state.total);
}

/// Runs a function on a thread, and lets another one wait for its end.
class WorkThread {
 public:
  explicit WorkThread(std::function<void()> work)
      : thread_([this, work = std::move(work)] {
          try {
            work();
          } catch (...) {
            failure_ = std::current_exception();
          }
          const std::lock_guard lock(mutex_);
          ended_ = true;
          changed_.notify_all();
        }) {}

  bool wait_for(std::chrono::milliseconds time) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, time, [&] { return ended_; });
  }
  /// Once it has ended: throws what the work threw.
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool ended_ = false;
  std::exception_ptr failure_;
  std::jthread thread_;
};

}  // namespace

void run_interruptibly(const py::object& callback, const std::function<void(Reporter)>& work) {
  std::stop_source stop;
  CollectedProgress progress(stop.get_token());
  WorkThread thread([&] { work({progress, stop.get_token()}); });
  std::exception_ptr raised;
  {
    const py::gil_scoped_release release;
    while (!thread.wait_for(kPatience)) {
      if (raised) continue;
      const py::gil_scoped_acquire acquire;
      try {
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();
        report(callback, progress);
      } catch (...) {
        raised = std::current_exception();
        stop.request_stop();
      }
    }
  }
  if (raised) std::rethrow_exception(raised);
  thread.rethrow();
  report(callback, progress);
}

}  // namespace isobrick::python

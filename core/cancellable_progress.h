#pragma once

#include <stop_token>

#include <isobrick/error.h>
#include <isobrick/progress.h>

namespace isobrick::inline v0 {

/// Passes everything on, and throws Cancelled in place of it once a stop is requested.
class CancellableProgress final : public Progress {
 public:
  /// `progress` must outlive it.
  CancellableProgress(Progress& progress, std::stop_token cancel)
      : progress_(progress), cancel_(std::move(cancel)) {}

  void begin(std::string_view stage, std::uint64_t total) override {
    check();
    progress_.begin(stage, total);
  }
  void advance(std::uint64_t done) override {
    check();
    progress_.advance(done);
  }
  void end() override {
    check();
    progress_.end();
  }

 private:
  void check() const {
    if (cancel_.stop_requested()) throw Cancelled("the operation was cancelled");
  }

  Progress& progress_;
  std::stop_token cancel_;
};

}  // namespace isobrick

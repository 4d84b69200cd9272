#include "viewer/app/isovalue_stats.h"

#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/progress.h>
#include "core/file_error.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kBins = 256;

/// Cancels the count when `stop` is set.
class StopCheck final : public Progress {
 public:
  explicit StopCheck(const std::atomic<bool>& stop) : stop_(stop) {}
  void begin(std::string_view, std::uint64_t) override { check(); }
  void advance(std::uint64_t) override { check(); }
  void end() override {}

 private:
  void check() const {
    if (stop_) throw Cancelled("stopped");
  }
  const std::atomic<bool>& stop_;
};

}  // namespace

IsovalueStats::IsovalueStats(std::shared_ptr<const StoreReader> store)
    : counts_(*store_bricks(store)) {
  thread_ = std::thread([this, store = std::move(store)] {
    try {
      StopCheck progress(stop_);
      auto counted =
          std::make_shared<const Histogram>(isobrick::histogram(*store, progress, kBins, true));
      const MutexLock lock(mutex_);
      if (counted->left_out > 0)
        failure_ = fmt::format("the histogram lacks bricks that cannot be read, {} of level {}: {}",
                               counted->left_out, counted->level, counted->damage);
      histogram_ = std::move(counted);
    } catch (const Cancelled&) {
      // The destructor cancelled it.
    } catch (const std::exception& error) {
      const MutexLock lock(mutex_);
      failure_ = "the histogram cannot be counted: " + error_message(error);
    }
  });
}

IsovalueStats::~IsovalueStats() {
  stop_ = true;
  thread_.join();
}

std::shared_ptr<const Histogram> IsovalueStats::histogram() const {
  const MutexLock lock(mutex_);
  return histogram_;
}

std::string IsovalueStats::take_failure() {
  const MutexLock lock(mutex_);
  return std::exchange(failure_, {});
}

double IsovalueStats::triangles(double isovalue, const StreamCounters& made) const {
  const std::uint64_t blocks = counts_.active_blocks(isovalue);
  double each = made.triangles_per_block;
  // Too few blocks for the average may still be all blocks of a small surface. Else the estimate is
  // that of cuts.
  if (each == 0 && made.blocks_made > 0 && made.blocks_made >= blocks)
    each = static_cast<double>(made.triangles_made) / static_cast<double>(made.blocks_made);
  if (each == 0) each = CutBudget().triangles_per_block;
  return each * static_cast<double>(blocks);
}

}  // namespace isobrick

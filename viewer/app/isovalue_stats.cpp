#include "viewer/app/isovalue_stats.h"

#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/progress.h>
#include "core/file_error.h"

namespace isobrick {
namespace {

constexpr int kBins = 256;

/// Ends a count that nobody waits for.
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
      // Nobody waits for it any more.
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
  // A small surface is measured once as much as all of it was made; until then as cuts guess.
  if (each == 0 && made.blocks_made > 0 && made.blocks_made >= blocks)
    each = static_cast<double>(made.triangles_made) / static_cast<double>(made.blocks_made);
  if (each == 0) each = CutBudget().triangles_per_block;
  return each * static_cast<double>(blocks);
}

}  // namespace isobrick

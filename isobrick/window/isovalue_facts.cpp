#include "isobrick/window/isovalue_facts.h"

#include "isobrick/core/error.h"
#include "isobrick/core/progress.h"

namespace isobrick {
namespace {

constexpr int kBins = 256;

/// Ends a count that nobody waits for.
class Stoppable final : public Progress {
 public:
  explicit Stoppable(const std::atomic<bool>& stop) : stop_(stop) {}
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

IsovalueFacts::IsovalueFacts(std::shared_ptr<const StoreReader> store)
    : counts_(*store_bricks(store)) {
  thread_ = std::thread([this, store = std::move(store)] {
    try {
      Stoppable progress(stop_);
      auto counted =
          std::make_shared<const Histogram>(isobrick::histogram(*store, progress, kBins));
      const std::scoped_lock lock(mutex_);
      histogram_ = std::move(counted);
    } catch (const std::exception&) {
      // Stopped, or a damaged brick: the picture says so where it is seen.
    }
  });
}

IsovalueFacts::~IsovalueFacts() {
  stop_ = true;
  thread_.join();
}

std::shared_ptr<const Histogram> IsovalueFacts::histogram() const {
  const std::scoped_lock lock(mutex_);
  return histogram_;
}

}  // namespace isobrick

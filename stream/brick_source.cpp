#include "stream/brick_source.h"

#include <fmt/format.h>

#include <utility>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

class StoreBricks final : public BrickSource {
 public:
  explicit StoreBricks(std::shared_ptr<const StoreReader> store) : store_(std::move(store)) {}

  const StoreInfo& info() const override { return store_->info(); }
  bool read_brick(int level, Int3 brick, std::byte* out) const override {
    return store_->read_brick(level, brick, out);
  }
  void will_need(int level, Int3 brick) const override {
    if (!store_->reads_memory()) store_->will_need(level, brick);
  }
  RangeTable brick_ranges(int level, Box3 box) const override {
    return store_->brick_ranges(level, box);
  }
  RangeTable block_ranges(int level, Box3 box) const override {
    return store_->block_ranges(level, box);
  }
  BrickTimes times() const override { return store_->brick_times(); }

 private:
  std::shared_ptr<const StoreReader> store_;
};

}  // namespace

std::shared_ptr<const BrickSource> store_bricks(std::shared_ptr<const StoreReader> store) {
  for (std::size_t level = 0; level < store->info().levels.size(); ++level)
    if (!store->has_ranges(static_cast<int>(level)))
      throw Error(
          fmt::format("level {} of '{}' has no ranges yet, without which nothing can be shown; "
                      "run: {}",
                      level, store->info().name, index_command(store->info())));
  return std::make_shared<StoreBricks>(std::move(store));
}

}  // namespace isobrick

#pragma once

#include <memory>
#include <utility>

#include "stream/brick_source.h"

namespace isobrick::test {

/// Forwards to another source; derived classes replace read_brick().
class ForwardingSource : public BrickSource {
 public:
  explicit ForwardingSource(std::shared_ptr<const BrickSource> from) : from_(std::move(from)) {}
  const StoreInfo& info() const override { return from_->info(); }
  RangeTable brick_ranges(int level, Box3 bricks) const override {
    return from_->brick_ranges(level, bricks);
  }
  RangeTable block_ranges(int level, Box3 blocks) const override {
    return from_->block_ranges(level, blocks);
  }

 protected:
  std::shared_ptr<const BrickSource> from_;
};

}  // namespace isobrick::test

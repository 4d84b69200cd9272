#include "ranks/share_plans.h"

#include <cstddef>

namespace isobrick::inline v0 {
namespace {

/// Of the plans what is no list.
struct PlanHead {
  Box3 bounds;
  Int3 grid;
  std::uint64_t looks_around = 0;
};

}  // namespace

PartPlans share_plans(Ranks& ranks, const std::function<PartPlans()>& make) {
  Ranks::Bytes bytes;
  if (ranks.rank() == 0) {
    const PartPlans plans = make();
    const PlanHead head{plans.bounds, plans.grid, plans.looks_around};
    bytes = to_bytes(std::span<const PlanHead>(&head, 1));
    const Ranks::Bytes parts = to_bytes(std::span<const PartPlans::Plan>(plans.parts));
    bytes.insert(bytes.end(), parts.begin(), parts.end());
  }
  bytes = from_first(ranks, bytes);
  const auto list = bytes.begin() + static_cast<std::ptrdiff_t>(sizeof(PlanHead));
  const PlanHead head = to_items<PlanHead>({bytes.begin(), list}).front();
  return {.parts = to_items<PartPlans::Plan>({list, bytes.end()}),
          .bounds = head.bounds,
          .grid = head.grid,
          .looks_around = head.looks_around != 0};
}

}  // namespace isobrick

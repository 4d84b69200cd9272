#pragma once

#include <cstdint>
#include <functional>

#include <isobrick/progress.h>
#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// Calls f(part) for the parts of `bricks`, a box of a level's bricks, whose ranges lie in one
/// file each.
void for_each_range_file(Box3 bricks, const std::function<void(Box3 part)>& f);

/// Calls f(brick) for the bricks of a level that hold samples of `box` (in samples) and are
/// stored. Ranges show which bricks can hold anything but the fill value, and only those are
/// looked up. Without ranges all are, as well as where the fill value is a zero, whose sign
/// ranges lack. Every brick of the box advances `progress` by its bytes. Returns how many were
/// looked up.
std::uint64_t for_each_stored_brick(const StoreReader& store, int level, Box3 box,
                                    Progress& progress, const std::function<void(Int3 brick)>& f);

}  // namespace isobrick

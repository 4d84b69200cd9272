#pragma once

#include <cstdint>
#include <functional>

#include "isobrick/bricks/store_reader.h"

namespace isobrick {

/// Calls f(brick) for the bricks of a level that hold samples of `box` (in samples) and are
/// stored. Where there are ranges, these tell in which bricks there can be anything but the
/// fill value, a file of them for 32³ bricks, and only those are looked up; else all are.
/// Returns how many were looked up.
std::uint64_t for_each_stored_brick(const StoreReader& store, int level, Box3 box,
                                    const std::function<void(Int3 brick)>& f);

}  // namespace isobrick

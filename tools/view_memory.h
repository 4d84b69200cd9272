#pragma once

#include <cstdint>

#include <isobrick/store_reader.h>
#include "tools/parse.h"
#include "viewer/app/picture_setup.h"

namespace isobrick::tools {

/// Divides budgets.memory, the host's whole, for pictures of a store that are drawn into files:
/// what is left beside the program, OpenGL's driver and the picture is for bricks and meshes.
/// `software`: the device's memory is the host's as well, and is counted there. Throws UsageError
/// naming the least that works.
PictureBudgets divide_view_memory(const PictureBudgets& budgets, const StoreReader& store,
                                  PictureSize size, bool transparent, bool software);

}  // namespace isobrick::tools

#include "tools/view_memory.h"

#include <fmt/format.h>

#include <algorithm>

#include <isobrick/error.h>
#include "pipeline/program_memory.h"

namespace isobrick::tools {
namespace {

/// The least for bricks and meshes: with less a picture is too coarse to be of use.
constexpr std::uint64_t kMinScene = std::uint64_t{48} << 20;

/// Of a picture, the one before it, and its way to the file.
std::uint64_t picture_memory(PictureSize size, bool transparent) {
  constexpr std::uint64_t before = 4 * 5, to_file = 4 + 3 + 4;
  PictureSettings settings;
  settings.picking = true;
  const auto pixels =
      static_cast<std::uint64_t>(size.width) * static_cast<std::uint64_t>(size.height);
  return Renderer::memory(size.width, size.height, settings, transparent) +
         pixels * (before + to_file);
}

std::uint64_t min_scene(const StoreReader& store) {
  std::uint64_t brick = 0;
  for (const LevelInfo& level : store.info().levels)
    brick = std::max<std::uint64_t>(brick, level.lattice.brick_bytes());
  return kMinScene + 2 * brick;
}

}  // namespace

PictureBudgets divide_view_memory(const PictureBudgets& budgets, const StoreReader& store,
                                  PictureSize size, bool transparent, bool software) {
  // A device holds its pictures itself.
  const std::uint64_t picture = software ? picture_memory(size, transparent) : 0;
  const std::uint64_t fixed = kProgramBytes + Renderer::driver_memory() + picture;
  const std::uint64_t least = fixed + min_scene(store);
  if (budgets.memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: a picture of {} x {} pixels needs --memory "
        "{}M at least, {} MiB of it for the program and its libraries, {} for OpenGL's driver, "
        "{:.1f} for the picture, the rest for bricks and meshes; or choose a smaller --size",
        in_mib(budgets.memory), size.width, size.height, mib_above(least), kProgramBytes >> 20,
        Renderer::driver_memory() >> 20, in_mib(picture)));
  PictureBudgets divided = budgets;
  divided.memory = budgets.memory - fixed;
  if (!software) return divided;
  divided.device_memory = std::min(budgets.device_memory, divided.memory / 3);
  divided.memory -= divided.device_memory;
  return divided;
}

}  // namespace isobrick::tools

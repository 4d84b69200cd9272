#include "python/src/colours.h"

#include <array>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/mesh_file_sink.h>

namespace isobrick::python {
namespace {

ColourMap colour_map_of(const std::string& name) {
  constexpr std::array<std::pair<const char*, ColourMap>, 3> known{
      {{"viridis", ColourMap::viridis},
       {"coolwarm", ColourMap::coolwarm},
       {"grey", ColourMap::grey}}};
  for (const auto& [text, map] : known)
    if (name == text) return map;
  throw UsageError(
      fmt::format("colour_map must be 'viridis', 'coolwarm' or 'grey', not '{}'", name));
}

}  // namespace

std::optional<AttributeColours> colours_of(const ColourArguments& arguments,
                                           const std::string& path) {
  if (!arguments) return std::nullopt;
  const auto& [attribute, low, high, map] = *arguments;
  AttributeColours colours{
      .attribute = attribute, .low = low, .high = high, .map = colour_map_of(map)};
  const auto format = find_mesh_format(std::filesystem::path(path).extension().string());
  if (format && format != MeshFormat::ply && format != MeshFormat::glb)
    throw UsageError(
        fmt::format("colour_by is for GLB and PLY, and this mesh becomes {}, whose "
                    "readers colour by the attribute itself",
                    name_of(*format)));
  return colours;
}

}  // namespace isobrick::python

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include <isobrick/attributes.h>
#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

constexpr VertexColour kUnknown{128, 128, 128, 255};

constexpr VertexColour rgb(std::uint32_t number) {
  return {static_cast<std::uint8_t>(number >> 16), static_cast<std::uint8_t>(number >> 8 & 255),
          static_cast<std::uint8_t>(number & 255), 255};
}

/// Colours at equal steps of sRGB, between which a scale is linear.
constexpr std::array kViridis{rgb(0x440154), rgb(0x472d7b), rgb(0x3b528b),
                              rgb(0x2c728e), rgb(0x21918c), rgb(0x28ae80),
                              rgb(0x5ec962), rgb(0xaddc30), rgb(0xfde725)};
constexpr std::array kCoolWarm{rgb(0x3b4cc0), rgb(0xdddddd), rgb(0xb40426)};
constexpr std::array kGreys{rgb(0x000000), rgb(0xffffff)};

std::span<const VertexColour> steps_of(ColourMap map) {
  switch (map) {
    case ColourMap::viridis: return kViridis;
    case ColourMap::coolwarm: return kCoolWarm;
    case ColourMap::grey: return kGreys;
  }
  throw UsageError("no such scale of colours");
}

}  // namespace

VertexColour AttributeColours::colour_of(float value) const {
  if (std::isnan(value)) return kUnknown;
  const std::span<const VertexColour> steps = steps_of(map);
  const double part = std::clamp((double{value} - low) / (high - low), 0.0, 1.0);
  const double at = part * static_cast<double>(steps.size() - 1);
  const std::size_t first = std::min(static_cast<std::size_t>(at), steps.size() - 2);
  const double rest = at - static_cast<double>(first);
  VertexColour colour{0, 0, 0, 255};
  for (std::size_t i = 0; i < 3; ++i)
    colour[i] = static_cast<std::uint8_t>(
        std::lround(steps[first][i] * (1 - rest) + steps[first + 1][i] * rest));
  return colour;
}

ColourSink::ColourSink(MeshSink& sink, AttributeColours colours)
    : sink_(sink), colours_(std::move(colours)) {
  if (!std::isfinite(colours_.low) || !std::isfinite(colours_.high) ||
      colours_.low == colours_.high)
    throw UsageError(fmt::format("colours cannot go from {} to {}: choose two values", colours_.low,
                                 colours_.high));
}

void ColourSink::begin(const MeshHeader& header) {
  const auto& names = header.attributes;
  const auto at = std::find(names.begin(), names.end(), colours_.attribute);
  if (at == names.end())
    throw UsageError(fmt::format(
        "the mesh has no attribute '{}' to be coloured by; it has {}", colours_.attribute,
        names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
  attribute_ = static_cast<std::size_t>(at - names.begin());
  MeshHeader coloured = header;
  coloured.has_colours = true;
  sink_.begin(coloured);
}

void ColourSink::write(const MeshChunk& chunk) {
  const std::span<const float> values = chunk.attributes[attribute_].values;
  of_chunk_.resize(values.size());
  std::transform(values.begin(), values.end(), of_chunk_.begin(),
                 [&](float value) { return colours_.colour_of(value); });
  MeshChunk coloured = chunk;
  coloured.colours = of_chunk_;
  sink_.write(coloured);
}

}  // namespace isobrick

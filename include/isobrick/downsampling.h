#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace isobrick::inline v0 {

/// What a sample of a coarser level is of the samples that it stands for. `mode` is the most
/// frequent value, as label images need; `stride` is the first sample.
enum class Downsampling : std::uint8_t { mean, max, min, mode, stride };

inline constexpr Downsampling kDownsamplings[] = {Downsampling::mean, Downsampling::max,
                                                  Downsampling::min, Downsampling::mode,
                                                  Downsampling::stride};

/// "mean", "max", …: the names of the command line and of `multiscales[].type`.
constexpr std::string_view name_of(Downsampling downsampling) {
  constexpr std::string_view names[] = {"mean", "max", "min", "mode", "stride"};
  return names[static_cast<int>(downsampling)];
}

constexpr std::optional<Downsampling> parse_downsampling(std::string_view name) {
  for (const Downsampling downsampling : kDownsamplings)
    if (name == name_of(downsampling)) return downsampling;
  return std::nullopt;
}

}  // namespace isobrick

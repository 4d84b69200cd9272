#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "isobrick/io/volume_source.h"

namespace isobrick {

enum class ByteOrder : std::uint8_t { little, big };

/// What the caller says about a raw file. What is not said is taken from a
/// detached header (`x.nhdr`, `x.mhd` beside it, or given itself) or from a
/// name such as `engine_256x256x128_uint8.raw`.
struct RawDescription {
  std::optional<Int3> extent;
  std::optional<ScalarType> type;
  std::optional<ByteOrder> order;
  std::optional<std::uint64_t> offset;  ///< bytes before the first sample
  std::optional<Vec3d> spacing;
  std::optional<Vec3d> origin;
  std::optional<std::string> unit;
};

/// Opens a raw file, its detached header, or standard input ("-").
/// Throws UsageError when the extent or the type is not known, is zero or
/// overflows, or when the file's size is not what they say (both numbers are
/// named); Error when the file cannot be opened.
std::unique_ptr<VolumeSource> open_source(const std::string& path, const RawDescription& said);

}  // namespace isobrick

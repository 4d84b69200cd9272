#pragma once

#include <filesystem>

namespace isobrick {

/// The layout of a conversion under way; gone when the store is finished and has its name.
inline constexpr const char* kLayoutMarker = ".isobrick-layout.json";

/// Checksums of the input of a conversion under way; removed right after the marker.
inline constexpr const char* kConvertJournal = "convert.journal";

inline constexpr const char* kTemporarySuffix = ".tmp";

/// The name under which a file of a store is written until it is whole.
inline std::filesystem::path temporary_name(std::filesystem::path path) {
  path += kTemporarySuffix;
  return path;
}

inline bool is_temporary_name(const std::filesystem::path& path) {
  return path.extension() == kTemporarySuffix;
}

}  // namespace isobrick

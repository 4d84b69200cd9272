#pragma once

#include <filesystem>
#include <string>

#include "bricks/storage/storage_keys.h"

namespace isobrick::inline v0 {

/// The layout of a conversion under way; gone when the store is finished and has its name.
inline constexpr const char* kLayoutMarker = ".isobrick-layout.json";

/// Checksums of the input of a conversion under way; removed right after the marker.
inline constexpr const char* kConvertJournal = "convert.journal";

inline constexpr const char* kTemporarySuffix = ".tmp";

/// The key of what is added to a level below `additions`, itself a key: "isobrick/0/range".
inline std::string level_addition(const std::string& additions, int level,
                                  const std::string& name) {
  return join_key(additions, "isobrick/" + std::to_string(level) + '/' + name);
}

/// The name under which a file of a store is written until it is whole.
inline std::filesystem::path temporary_name(std::filesystem::path path) {
  path += kTemporarySuffix;
  return path;
}

inline bool is_temporary_name(const std::filesystem::path& path) {
  return path.extension() == kTemporarySuffix;
}

}  // namespace isobrick

#pragma once

namespace isobrick {

/// Tells an interrupted conversion's layout; gone when the store is finished and has its name.
inline constexpr const char* kLayoutMarker = ".isobrick-layout.json";

/// What the input of a conversion looked like; goes right after the marker.
inline constexpr const char* kConvertJournal = "convert.journal";

}  // namespace isobrick

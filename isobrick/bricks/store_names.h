#pragma once

namespace isobrick {

/// Tells an interrupted conversion's layout; gone when the store is finished.
inline constexpr const char* kLayoutMarker = ".isobrick-layout.json";

}  // namespace isobrick

#include "io/meshes/levels/manifest.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "io/meshes/levels/level_fragments.h"

namespace isobrick::inline v0 {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");

constexpr unsigned kHalves = 8;

template <class T>
void append_number(std::string& to, T number) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &number, sizeof(T));
  to.append(bytes, sizeof(T));
}

/// Adds empty fragments of these keys where there is none yet.
void add_missing(std::vector<EncodedFragment>& fragments, std::vector<std::uint64_t> keys) {
  std::ranges::sort(keys);
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  const std::size_t there = fragments.size();
  for (const std::uint64_t key : keys) {
    const auto at = std::lower_bound(
        fragments.begin(), fragments.begin() + static_cast<std::ptrdiff_t>(there), key,
        [](const EncodedFragment& f, std::uint64_t other) { return f.key < other; });
    const bool is_there =
        at != fragments.begin() + static_cast<std::ptrdiff_t>(there) && at->key == key;
    if (!is_there) fragments.push_back({.key = key});
  }
  std::ranges::sort(fragments, {}, &EncodedFragment::key);
}

}  // namespace

void complete_octree(std::vector<ManifestLevel>& levels) {
  std::vector<std::uint64_t> keys;
  for (std::size_t level = 1; level < levels.size(); ++level) {
    keys.clear();
    for (const EncodedFragment& child : levels[level - 1].fragments)
      keys.push_back(child.key / kHalves);
    add_missing(levels[level].fragments, keys);
  }
  for (std::size_t level = levels.size(); level-- > 1;) {
    keys.clear();
    for (const EncodedFragment& parent : levels[level].fragments)
      for (unsigned half = 0; half < kHalves; ++half)
        if ((parent.halves >> half & 1) != 0) keys.push_back(kHalves * parent.key + half);
    add_missing(levels[level - 1].fragments, keys);
  }
}

std::string manifest_bytes(const ChunkGrid& grid, const std::vector<ManifestLevel>& levels) {
  std::string bytes;
  for (int axis = 0; axis < 3; ++axis) append_number(bytes, grid.edge);
  for (const float origin : grid.origin) append_number(bytes, origin);
  append_number(bytes, static_cast<std::uint32_t>(levels.size()));
  for (const ManifestLevel& level : levels) append_number(bytes, level.scale);
  bytes.append(levels.size() * 3 * sizeof(float), '\0');  // offsets of vertices
  for (const ManifestLevel& level : levels)
    append_number(bytes, static_cast<std::uint32_t>(level.fragments.size()));
  for (const ManifestLevel& level : levels) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const EncodedFragment& fragment : level.fragments)
        append_number(bytes, cell_of_key(fragment.key)[axis]);
    for (const EncodedFragment& fragment : level.fragments) append_number(bytes, fragment.bytes);
  }
  return bytes;
}

}  // namespace isobrick

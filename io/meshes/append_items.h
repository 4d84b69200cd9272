#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// Appends `count` items of kItem bytes each: put(to, i) writes item i in place.
template <std::size_t kItem, class Put>
void append_items(FileWriter& out, std::uint64_t count, const Put& put) {
  constexpr std::uint64_t batch = FileWriter::kBuffer / kItem;
  for (std::uint64_t first = 0; first < count; first += batch) {
    const std::uint64_t end = std::min(count, first + batch);
    const auto bytes = static_cast<std::size_t>(end - first) * kItem;
    std::byte* to = out.reserve(bytes);
    for (std::uint64_t i = first; i < end; ++i, to += kItem) put(to, i);
    out.commit(bytes);
  }
}

}  // namespace isobrick

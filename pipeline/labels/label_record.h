#pragma once

#include <cstddef>
#include <cstdint>

#include "surface/labels/label_piece.h"

namespace isobrick::inline v0 {

/// What a tile has of one label, as it lies in files: this, then the items in their order.
struct LabelRecord {
  std::uint64_t tile = 0;   ///< its Morton code
  std::uint64_t label = 0;  ///< its bits
  std::uint32_t vertices = 0, foreign = 0, quads = 0;
  std::uint32_t unused = 0;

  std::size_t item_bytes() const {
    return vertices * sizeof(LabelVertex) + foreign * sizeof(ForeignVertex) +
           quads * sizeof(LabelQuad);
  }
};
static_assert(sizeof(LabelRecord) == 32 && sizeof(LabelVertex) == 16);

}  // namespace isobrick

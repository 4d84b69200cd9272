#pragma once

#include <cstdint>
#include <memory>

#include "io/bytes/byte_stream.h"

namespace isobrick::inline v0 {

/// How VTK cuts an array into blocks that are compressed one by one.
struct BlockTable {
  std::uint64_t blocks = 0;
  std::uint64_t block_bytes = 0;  ///< of a block unpacked
  std::uint64_t last_bytes = 0;   ///< of the last one, if it is shorter; 0: it is not
  int entry_bytes = 4;            ///< of the size of a packed block in the table, 4 or 8
  bool swap = false;              ///< these sizes are of the other byte order
};

/// What the blocks unpack to (zlib). `sizes` yields the bytes of each packed block
/// in turn, `packed` the blocks themselves. Throws DamageError for a block that
/// does not unpack to its size, UsageError for a table that makes no sense.
std::unique_ptr<ByteStream> make_zlib_block_stream(const BlockTable& table,
                                                   std::unique_ptr<ByteStream> sizes,
                                                   std::unique_ptr<ByteStream> packed);

}  // namespace isobrick

#pragma once

#include <isobrick/index_build.h>
#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// Makes a part of an index. See IndexOptions::part. `memory` is what decoding leaves of the
/// budget. In the caller's arena.
IndexReport make_index_part(const StoreReader& store, const IndexOptions& options,
                            std::uint64_t memory, int threads, Progress& progress);

}  // namespace isobrick

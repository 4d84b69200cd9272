#pragma once

#include <cstddef>
#include <vector>

#include <isobrick/scalar.h>
#include <isobrick/vec.h>

namespace isobrick::bench {

/// Seconds in which the GPU decodes so many copies of packed bricks, which lie in its memory one
/// after the other, the first of several runs left out. Compares the first copies with `samples`
/// and throws Error where they differ.
double decode_on_device(ScalarType type, Int3 extent,
                        const std::vector<std::vector<std::byte>>& packed,
                        const std::vector<std::vector<std::byte>>& samples, std::size_t copies);

}  // namespace isobrick::bench

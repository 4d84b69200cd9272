#pragma once

#include <cstddef>
#include <span>

#include <isobrick/pod_buffer.h>

namespace isobrick::inline v0 {

/// The number that h5py registered for its filter "lzf".
inline constexpr int kHdf5LzfFilter = 32000;

/// Unpacks what LibLZF packed into exactly `size` bytes. Throws DamageError saying what is
/// wrong, not where. Thread-safe.
void unpack_lzf(std::span<const std::byte> packed, std::size_t size, PodBuffer<std::byte>& out);

/// Lets libhdf5 read the filter, for datasets whose other filters are left to it.
void register_hdf5_lzf();

}  // namespace isobrick

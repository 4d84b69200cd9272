#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>

#include <isobrick/brick_codec.h>
#include <isobrick/lattice.h>
#include <isobrick/volume_source.h>
#include "bricks/store_layout.h"

namespace isobrick::inline v0 {

/// Reads brick `b`, whole and padded as it is encoded, into its bytes. False: it is not stored,
/// which is known without reading it. Called by several threads at once.
using BrickRead = std::function<bool(Int3 b, std::span<std::byte>)>;

/// Encodes some bricks of a lattice by both codecs, with the threads of the caller's arena. Which
/// ones depends on the lattice and on which of them are stored, so that it is the same each time.
/// At most a few hundred bricks are asked for, and of 64 MiB or 4 bricks some are read.
CodecSample sample_bricks(const Lattice& lattice, const SampleValue& fill_value, int zstd_level,
                          const BrickRead& read);

/// The same of the finest level of a store that a source with random access is to become, in rows
/// of bricks along x, within a sixteenth of a budget. Of a file whose planes are compressed it
/// reads a few hundred planes.
CodecSample sample_source(VolumeSource& source, const StoreLayout& layout, int threads,
                          std::uint64_t memory);

/// packed where it takes at most `factor` times the bytes of zstd, else zstd.
BrickCodec better_codec(const CodecSample& sample, double factor);

/// Bytes that sample_bricks() takes with so many threads; a part of them is kept.
std::size_t sampling_bytes(const Lattice& lattice, int zstd_level, int threads);
/// As many of `threads` as take an eighth of a budget, but one.
int sampling_threads(const Lattice& lattice, int zstd_level, std::uint64_t memory, int threads);

/// Throws UsageError for a level of zstd, a factor, or a packed codec in Zarr version 2, that
/// cannot be.
void check_codec(BrickCodec codec, int zstd_level, double packed_factor, OmeVersion ome);

/// Gives the layout the codec of the interrupted conversion in `staging`, which was begun with
/// BrickCodec::automatic.
void take_begun_codec(const std::filesystem::path& staging, StoreLayout& layout);

}  // namespace isobrick

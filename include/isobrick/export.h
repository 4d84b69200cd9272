#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stop_token>

#include <isobrick/api.h>
#include <isobrick/inside.h>
#include <isobrick/progress.h>
#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// The files that samples can become. A raw file has a NRRD header beside it, OUT.nhdr. A zip holds
/// the store itself: all levels, with ranges and indices.
enum class ExportFormat : std::uint8_t { raw, nrrd, vdb, zip };

/// Wider bands of a level set are of no use.
inline constexpr int kWidestHalfBand = 100;

/// What to write of a store.
struct ExportOptions {
  ExportFormat format = ExportFormat::raw;  ///< of the file
  /// Of OpenVDB: a level set of this isosurface in place of the samples.
  std::optional<double> isovalue = {};
  std::optional<Inside> inside = {};  ///< of that; as ExtractOptions::inside
  int half_band = 3;  ///< voxels with distances on either side of that, 1 … kWidestHalfBand
  int level = 0;      ///< 0: the finest
  std::optional<Box3> roi = {};  ///< samples of that level; nothing: all
  bool force = false;            ///< replace a file that exists, once the new one is whole
  std::uint64_t memory = std::uint64_t{1} << 30;  ///< hard budget, bytes
  int threads = 0;                                ///< 0: all cores
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
};

/// Writes the samples of one level (or of a region) bit for bit, C order [z, y, x],
/// little endian; as NRRD behind a header that keeps their place in world space, as raw with such
/// a header beside it. `-` is standard output, for raw (without a header then), NRRD and zip.
/// As zip: as write_zip(); with a level, a region or an isovalue a UsageError.
/// As OpenVDB: a sparse grid with the same samples and place; smaller integers
/// become int32, u32 becomes int64. With an isovalue a level set (export_level_set.h).
/// Memory: one row of bricks at a time, within the budget; for OpenVDB also the
/// grid, which must be whole before it can be written: its samples that are not
/// the fill value, or a UsageError once they exceed the budget. Nothing appears under
/// the final name until it is whole. Returns the bytes of the file.
ISOBRICK_API std::uint64_t export_volume(const StoreReader& store, const std::filesystem::path& out,
                                         const ExportOptions& options,
                                         Progress& progress = no_progress());

}  // namespace isobrick

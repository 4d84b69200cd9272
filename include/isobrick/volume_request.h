#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <isobrick/api.h>
#include <isobrick/array_view.h>
#include <isobrick/transform.h>
#include <isobrick/vec.h>
#include <isobrick/volume_source.h>

namespace isobrick::inline v0 {

/// How the bytes of a sample lie in a file.
enum class ByteOrder : std::uint8_t { little, big };
/// The byte order of this machine.
inline constexpr ByteOrder kNativeOrder =
    std::endian::native == std::endian::little ? ByteOrder::little : ByteOrder::big;

/// A box of which every bound may be left out; half-open.
struct RegionRequest {
  std::array<std::optional<Index>, 3> lo = {};  ///< the first sample along x, y, z
  std::array<std::optional<Index>, 3> hi = {};  ///< behind the last sample along x, y, z
};

/// A box of world space that is not empty.
struct WorldRegion {
  Vec3d lo = {};  ///< the lower corner
  Vec3d hi = {};  ///< the upper corner
};

/// The samples of a volume of so many that are requested. Throws UsageError for a region that is
/// empty or leaves the volume.
ISOBRICK_API Box3 resolve_region(const RegionRequest& region, Int3 extent);

/// The bounds of a region in the index space of a volume, lower corner first; in one whose axes are
/// turned, those of the box around it.
ISOBRICK_API std::array<Vec3d, 2> index_bounds(const WorldRegion& region,
                                               const Transform& transform);

/// The smallest box of samples that covers what a volume has of `region`; in a volume whose axes
/// are turned, the box around the region. Throws UsageError where they do not touch.
ISOBRICK_API Box3 covering_samples(const WorldRegion& region, const Transform& transform,
                                   Int3 extent);

/// What the caller specifies about a volume. The first four members are for raw files, where
/// they override a header beside the file and the file's name. The others
/// are for all formats and override the file.
struct VolumeRequest {
  std::optional<Int3> extent = {};           ///< samples along x, y, z
  std::optional<ScalarType> type = {};       ///< of the samples
  std::optional<ByteOrder> order = {};       ///< of the samples
  std::optional<std::uint64_t> offset = {};  ///< bytes before the first sample
  std::optional<Vec3d> spacing = {};         ///< as Transform::spacing
  std::optional<Vec3d> origin = {};          ///< as Transform::origin
  std::optional<std::string> unit = {};      ///< as Transform::unit
  Selection selection = {};                  ///< of a file with several volumes
  std::optional<std::string> grid = {};      ///< of an OpenVDB file
  std::optional<RegionRequest> bounds = {};  ///< of a sparse grid, in its own index coordinates
  Int3 stride{1, 1, 1};                      ///< the first of so many samples along x, y, z
  std::optional<RegionRequest> roi = {};     ///< of those only these
  std::optional<WorldRegion> region = {};    ///< only these; in world space, with all above applied
  /// Samples of this value are missing and become NaN, so that no surface touches them. Integers
  /// become f32, those of 32 bits f64.
  std::optional<double> nodata = {};
  /// Bytes that a source may take for itself: one that holds its samples in
  /// memory refuses when it needs more; nothing: as many as it likes.
  std::optional<std::uint64_t> memory = {};
  int threads = 0;  ///< with which a source may decode by itself; 0: all cores
};

/// Describes a volume by its file and the request. Throws UsageError for
/// extents and geometry that make no sense.
ISOBRICK_API VolumeInfo describe_volume(const std::string& path, Int3 extent, ScalarType type,
                                        Transform transform, const VolumeRequest& request);

/// Throws UsageError when the caller describes raw samples although the file, a
/// `format` ("a NIfTI file"), describes itself.
ISOBRICK_API void refuse_raw_description(const std::string& path, std::string_view format,
                                         const VolumeRequest& request);

/// Throws UsageError for a grid or bounds of grids where there are none.
ISOBRICK_API void refuse_grid(const std::string& path, const VolumeRequest& request);

/// Throws UsageError for a channel or a time that a file with one of each lacks.
ISOBRICK_API void refuse_selection(const std::string& path, const VolumeRequest& request);

}  // namespace isobrick

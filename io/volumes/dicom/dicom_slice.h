#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <isobrick/scalar.h>
#include <isobrick/vec.h>
#include "io/volumes/scaled_source.h"

namespace isobrick::inline v0 {

/// The image of a DICOM file.
struct DicomSlice {
  std::string path;
  std::string series;                ///< its SeriesInstanceUID
  Int3 extent;                       ///< columns, rows, frames
  ScalarType type = ScalarType::u8;  ///< as stored
  int bits = 8;                      ///< that are used of each sample, the lowest
  ValueScale scale;
  /// Of columns, rows, frames or slices. That of frames is negative where they go against the
  /// normal, row × column.
  Vec3d spacing{1, 1, 1};
  /// Whether the file states the distance of its frames. A dose does so by its
  /// GridFrameOffsetVector only.
  bool has_frame_step = false;
  std::optional<Vec3d> position;        ///< of the first sample in space, millimetres
  Vec3d row{1, 0, 0}, column{0, 1, 0};  ///< directions in which x and y grow
  Index time = 0, instance = 0;         ///< TemporalPositionIdentifier, InstanceNumber
};

/// The usual one of steps between slices: the lower median of their sizes. At least one.
double usual_step(std::vector<double> steps);

/// How far steps may differ from `step` and still be even: files write positions with few digits.
double step_tolerance(double step);

/// Reads a file without its samples; nothing for a DICOMDIR and what else is no
/// image. Throws UsageError for what is not supported, DamageError where the file
/// is damaged. From any number of threads.
std::optional<DicomSlice> read_dicom_slice(const std::string& path);

/// Copies one frame of a file to `out`, as stored, unused bits cleared (or equal
/// to the sign). Decompresses (JPEG, JPEG-LS, RLE). From any number of threads.
void read_dicom_frame(const DicomSlice& slice, Index frame, std::byte* out);

}  // namespace isobrick

#pragma once

#include <cstddef>
#include <span>
#include <string>

#include <isobrick/array_view.h>
#include <isobrick/scalar.h>
#include <isobrick/transform.h>
#include "io/volumes/scaled_source.h"

namespace isobrick::inline v0 {

/// The header of a NIfTI file.
struct NiftiHeader {
  ArrayView view;
  ScalarType type;
  bool swap = false;         ///< of the other byte order
  bool detached = false;     ///< the samples lie in a file of their own (.hdr and .img)
  std::uint64_t offset = 0;  ///< of the first sample of the array
  ValueScale scale;
  bool is_label_image = false;  ///< its intent is NIFTI_INTENT_LABEL
  Transform transform;          ///< to the space of sform, else of qform, else of the spacing alone
};

/// Bytes of the longer one of both headers, NIfTI-2's.
inline constexpr std::size_t kNiftiHeaderBytes = 540;

/// Whether a file that begins so is NIfTI-1 or NIfTI-2, of either byte order.
bool is_nifti(std::span<const std::byte> head);

/// Whether it is the header of a pair, whose samples lie in another file.
bool is_nifti_pair(std::span<const std::byte> head);

/// Whether it is ANALYZE 7.5, whose headers parse_nifti_header() refuses with this.
bool is_analyze(std::span<const std::byte> head);
inline constexpr const char* kAnalyzeRefusal =
    "ANALYZE 7.5, which does not state where its samples are in space, is not supported; "
    "convert it to NIfTI";

/// Parses a header and selects one volume where there are several. `path` is for
/// messages. Throws UsageError.
NiftiHeader parse_nifti_header(const std::string& path, std::span<const std::byte> head,
                               const Selection& selection);

}  // namespace isobrick

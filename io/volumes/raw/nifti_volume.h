#pragma once

#include <memory>
#include <string>

#include <isobrick/volume_request.h>

namespace isobrick::inline v0 {

/// Opens a NIfTI-1 or NIfTI-2 volume: `.nii`, or `.hdr` with the `.img` beside it,
/// each also compressed as a whole (`.nii.gz`).
std::unique_ptr<VolumeSource> open_nifti(const std::string& path, const VolumeRequest& request);

/// The header that lies beside an image of a pair ("head.hdr" for "head.img", either
/// compressed or not); empty where the path is no such image's or no header lies there.
/// Throws UsageError for an image of ANALYZE 7.5.
std::string nifti_header_beside(const std::string& path);

/// What an image ("head.img") without such a header lacks, as the end of a message; empty for
/// other names.
std::string nifti_pair_hint(const std::string& path);

}  // namespace isobrick

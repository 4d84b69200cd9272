#include "isobrick/io/open_source.h"

#include "isobrick/io/nifti_volume.h"
#include "isobrick/io/raw_volume.h"
#include "isobrick/io/volume_format.h"

namespace isobrick {

std::unique_ptr<VolumeSource> open_source(const std::string& path, const VolumeRequest& said) {
  if (path == "-") return open_stdin(said);
  const VolumeFormat format = recognise_format(path);
  switch (format) {
    case VolumeFormat::nrrd:
    case VolumeFormat::meta_image:
      return open_text_volume(parse_text_header(path, format == VolumeFormat::nrrd, said.selection),
                              said);
    case VolumeFormat::nifti: return open_nifti(path, said);
    case VolumeFormat::raw: break;
  }
  return open_raw(path, said);
}

}  // namespace isobrick

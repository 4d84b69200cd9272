#include "io/volumes/vtk/vti_volume.h"

#include <fmt/format.h>

#include <utility>

#include "io/volumes/raw/raw_source.h"
#include "io/volumes/stream_source.h"
#include "io/volumes/vtk/vti_header.h"

namespace isobrick::inline v0 {

std::unique_ptr<VolumeSource> open_vti(const std::string& path, const std::string& array,
                                       const VolumeRequest& request) {
  refuse_raw_description(path, "a VTK image", request);
  const VtkFile vtk = vti_file(path);
  const VtiHeader header = parse_vti_header(vtk, array, request.selection);
  const std::size_t sample = size_of(header.type);
  SampleLayout layout;
  layout.info = describe_volume(path, header.view.extent, header.type, header.transform, request);
  layout.offset = static_cast<std::uint64_t>(header.view.first) * sample;
  layout.stride = header.view.stride;
  layout.swap = sample > 1 && header.array.swap;
  const std::uint64_t total = static_cast<std::uint64_t>(header.view.total) * sample;
  VtkNumbers numbers = open_vtk_array(vtk, header.array, header.type);
  const bool base64 = header.array.encoding == VtkEncoding::base64 && !header.array.compressed;
  if ((base64 || header.array.plain()) && numbers.bytes != total)
    vtk.fail(fmt::format("the array has {} bytes, but its extent makes {}", numbers.bytes, total));
  if (!header.array.plain())
    return make_stream_source(std::move(layout), std::move(numbers.stream), total,
                              base64 ? AfterEnd::unread : AfterEnd::refused);
  layout.offset += header.array.first_number();
  File file = open_input(path);
  check_header_promise(layout, file);
  return make_raw_source(std::move(layout), std::move(file));
}

}  // namespace isobrick

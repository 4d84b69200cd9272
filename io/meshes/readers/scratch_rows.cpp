#include "io/meshes/readers/scratch_rows.h"

#include <fmt/format.h>

#include "io/bytes/leftovers.h"

namespace isobrick::inline v0 {

ScratchBytes::ScratchBytes()
    : out_(open_scratch_beside((temporary_folder() / "isobrick").string())) {}

std::shared_ptr<MappedFile> ScratchBytes::map() {
  out_.flush();
  const File file = out_.share();
  return std::make_shared<MappedFile>(fmt::format("/proc/self/fd/{}", file.fd()));
}

VertexField ScratchRows::field(std::vector<std::shared_ptr<const void>>& keep, double scale) {
  const std::shared_ptr<MappedFile> mapped = bytes_.map();
  keep.push_back(mapped);
  constexpr NumberKind kind = NumberKind::f64;
  return {.first = mapped->bytes().data(),
          .stride = sizeof(Vec3d),
          .offsets = {0, 8, 16},
          .kinds = {kind, kind, kind},
          .scale = scale};
}

}  // namespace isobrick

#include "filters/vertex_numbers.h"

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

void check_narrow_count(std::uint64_t vertices) {
  // The largest number is left for what stands for none.
  if (vertices > kMaxNarrowVertices)
    throw Error(
        "the mesh has more than 4294967295 vertices, which filters of meshes cannot number; "
        "extract parts with --roi, or a coarser --level");
}

void check_takes(const MeshSink& to, bool wide, std::uint64_t vertices) {
  if (wide && !to.takes_wide())
    throw Error(fmt::format(
        "the filtered mesh has {} vertices, which this output cannot number: choose PVTP, VTP, "
        "OBJ, GLB, STL or levels of detail, or filter more",
        vertices));
}

}  // namespace isobrick

#include "gpu/tile/tile_params.h"
#include "surface/case_tables.h"

namespace isobrick::inline v0::gpu {

CaseTable make_case_table(bool mirrored) {
  const CaseTables& tables = mirrored ? kMirroredCaseTables : kCaseTables;
  CaseTable table{};
  for (std::size_t c = 0; c < 256; ++c) {
    table.triangle_count[c] = tables.triangles[c];
    for (std::size_t t = 0; t < tables.triangles[c]; ++t) {
      const std::uint8_t* e = tables.edges[c].data() + 3 * t;
      table.triangles[5 * c + t] = static_cast<std::uint16_t>((e[0] | e[1] << 4 | e[2] << 8) << 3);
    }
  }
  return table;
}

}  // namespace isobrick::gpu

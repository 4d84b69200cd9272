#include "filters/unit_stage.h"

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "core/vectors.h"

namespace isobrick::inline v0 {

void UnitStage::begin(const MeshHeader& header) {
  const auto ratio = unit_ratio(header.unit, unit_);
  if (!ratio)
    throw UsageError(
        fmt::format("the mesh cannot be in {}s: its own unit of length is not known", unit_));
  ratio_ = *ratio;
  MeshHeader scaled = header;
  scaled.unit = unit_;
  scaled.world_lo = header.world_lo * ratio_;
  scaled.world_hi = header.world_hi * ratio_;
  if (header.surface) scaled.surface = {header.surface->lo * ratio_, header.surface->hi * ratio_};
  next().begin(scaled);
}

void UnitStage::write(const MeshChunk& chunk) {
  check_cancelled();
  positions_.clear();
  for (const Vec3f& p : chunk.positions) positions_.push_back(to_float(to_double(p) * ratio_));
  MeshChunk scaled = chunk;
  scaled.positions = positions_;
  next().write(scaled);
}

}  // namespace isobrick

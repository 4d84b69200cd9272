#include "pipeline/convert/convert_units.h"

#include <algorithm>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "bricks/zarr/codec.h"

namespace isobrick::inline v0 {
namespace {

/// Shards that are smaller share a unit.
constexpr Index kUnitEdge = 512;

}  // namespace

ConvertUnits::ConvertUnits(const StoreLayout& layout, const std::filesystem::path& out)
    : lattice_(layout.levels.front().lattice), folder_(out.string() + ".parts") {
  const std::string marker = layout_marker(layout);
  layout_crc32c_ = crc32c(std::as_bytes(std::span(marker)));
  const Int3 shard = layout.levels.front().shard;
  for (int axis = 0; axis < 3; ++axis) {
    edge_[axis] = shard[axis] * std::max<Index>(1, kUnitEdge / shard[axis]);
    grid_[axis] = ceil_div(lattice_.extent[axis], edge_[axis]);
    if (grid_[axis] > 1 && edge_[axis] % kBlockEdge != 0)
      throw UsageError(fmt::format(
          "parts of a conversion need bricks of a multiple of {} samples, and these have {}",
          kBlockEdge, lattice_.brick[axis]));
  }
}

Box3 ConvertUnits::box(std::uint64_t unit) const {
  const Int3 at = point_at(static_cast<Index>(unit), grid_);
  return intersect({at * edge_, (at + Int3{1, 1, 1}) * edge_}, lattice_.box());
}

std::vector<std::uint64_t> ConvertUnits::begins_of(std::uint32_t parts) const {
  const auto all = static_cast<std::uint64_t>(volume(lattice_.extent));
  std::vector<std::uint64_t> begins{0};
  std::uint64_t before = 0;
  for (std::uint64_t unit = 0; unit < count(); ++unit) {
    // A unit belongs to the part that its middle lies in.
    const auto samples = static_cast<std::uint64_t>(volume(box(unit).extent()));
    const double middle = static_cast<double>(before) + static_cast<double>(samples) / 2;
    const auto part = static_cast<std::size_t>(middle / static_cast<double>(all) * parts);
    while (begins.size() <= std::min<std::size_t>(part, parts - 1)) begins.push_back(unit);
    before += samples;
  }
  begins.resize(std::size_t{parts} + 1, count());
  return begins;
}

std::filesystem::path ConvertUnits::folder_of(Part part) const {
  return folder_ / fmt::format("{}of{}", part.number, part.count);
}

std::filesystem::path ConvertUnits::file_of(Part part, std::uint64_t unit) const {
  return folder_of(part) / "units" / fmt::format("{}.unit", unit);
}

}  // namespace isobrick

#include "pipeline/labels/label_meshes.h"

#include <algorithm>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "core/stopwatch.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/in_order.h"
#include "pipeline/labels/label_mesh.h"

namespace isobrick::inline v0 {
namespace {

LabelTotals add_up(const std::vector<LabelChain>& chains) {
  LabelTotals totals{.labels = chains.size()};
  for (const LabelChain& chain : chains) {
    const MeshSize size{chain.vertices, 2 * chain.quads};
    totals.size.vertices += size.vertices;
    totals.size.triangles += size.triangles;
    totals.largest.vertices = std::max(totals.largest.vertices, size.vertices);
    totals.largest.triangles = std::max(totals.largest.triangles, size.triangles);
  }
  return totals;
}

}  // namespace

void LabelMeshes::append(std::span<const std::byte> packed) {
  spool_.append(packed);
  if (spool_.memory() <= plan_.label_bytes) return;
  throw UsageError(
      fmt::format("there are more than {} labels, and the memory budget has room for no more: "
                  "give more --memory, or choose --labels",
                  spool_.labels()));
}

/// Throws UsageError for a label that was named by itself and is not there.
void LabelMeshes::check_named(const std::vector<LabelChain>& chains) const {
  for (const LabelRange& range : image_.labels.ranges()) {
    if (range.first != range.last) continue;
    const auto at = std::lower_bound(
        chains.begin(), chains.end(), range.first,
        [](const LabelChain& chain, const Label& label) { return chain.label < label; });
    if (at == chains.end() || at->label != range.first)
      throw UsageError(
          fmt::format("{} has no label {}{}", image_.name, range.first.text(),
                      image_.roi != Box3{{0, 0, 0}, image_.extent} ? " in the region" : ""));
  }
}

MeshHeader LabelMeshes::header_of(const LabelChain& chain) const {
  // Half a sample beyond the region; smoothing may move a vertex to the border of its cell.
  const double beyond = image_.smoothing.iterations > 0 ? 1 : 0.5;
  const auto bounds = [&](Int3 first, Int3 last) {
    Vec3d lo, hi;
    for (int axis = 0; axis < 3; ++axis) {
      lo[axis] = static_cast<double>(std::max(first[axis], image_.roi.lo[axis])) - beyond;
      hi[axis] = static_cast<double>(std::min(last[axis], image_.roi.hi[axis] - 1)) + beyond;
    }
    return world_bounds(image_.transform, lo, hi);
  };
  const MeshBounds all = bounds(image_.roi.lo, image_.roi.hi);
  MeshHeader header{.world_lo = all.lo, .world_hi = all.hi};
  header.surface =
      bounds(chain.first_tile * kTileEdge, (chain.last_tile + Int3{1, 1, 1}) * kTileEdge);
  header.unit = unit_name(image_.transform.unit);
  return header;
}

void LabelMeshes::pass_on(const std::vector<LabelChain>& chains, const LabelVisitor& visit,
                          CancellableProgress& progress) {
  std::uint64_t quads = 0;
  for (const LabelChain& chain : chains) quads += chain.quads;
  progress.begin("writing meshes", 2 * quads * sizeof(Triangle));
  std::size_t next = 0;
  run_in_order<std::size_t>(
      plan_.at_a_time,
      [&](std::size_t& i) {
        i = next++;
        return i < chains.size();
      },
      [&](std::size_t& i) {
        visit(SpooledLabelMesh(spool_, chains[i], i, image_.transform, header_of(chains[i]),
                               plan_.cancel, plan_.max_narrow_vertices));
      },
      [&](std::size_t& i) { progress.advance(2 * chains[i].quads * sizeof(Triangle)); });
  progress.end();
}

LabelReport LabelMeshes::finish(Workers& workers, const LabelVisitor& visit, Progress& progress) {
  CancellableProgress cancellable(progress, plan_.cancel);
  LabelReport report;
  report.scratch_bytes = spool_.bytes();
  const std::vector<LabelChain> chains = spool_.finish();
  check_named(chains);
  const LabelTotals totals = add_up(chains);
  report.labels = totals.labels;
  report.vertices = totals.size.vertices;
  report.triangles = totals.size.triangles;
  if (plan_.check_totals) plan_.check_totals(totals);
  const Stopwatch watch(report.write_seconds);
  workers.execute([&] { pass_on(chains, visit, cancellable); });
  return report;
}

}  // namespace isobrick

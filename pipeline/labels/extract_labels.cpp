#include <isobrick/labels.h>

#include "core/stopwatch.h"
#include "pipeline/labels/label_meshes.h"
#include "pipeline/labels/store_label_pass.h"

namespace isobrick::inline v0 {

LabelReport extract_labels(const StoreReader& reader, const LabelOptions& options,
                           const LabelVisitor& visit, Progress& progress) {
  const StoreReader store = reader.native();
  LabelReport report, read;
  {
    const Stopwatch watch(read.seconds);
    const LabelImage image = label_image_of(store, options);
    const LabelPlan plan = plan_label_memory(store, options);
    LabelMeshes meshes(image, {options.scratch_beside, plan.label_bytes, plan.meshes,
                               options.cancel, options.check_totals});
    const LabelReport pass = run_label_pass(
        store, options, image, plan, {},
        [&](std::span<const std::byte> packed) { meshes.append(packed); }, progress);
    read.bricks = pass.bricks;
    read.bricks_read = pass.bricks_read;
    read.brick_reads = pass.brick_reads;
    read.bytes_read = pass.bytes_read;
    read.index_bytes = pass.index_bytes;
    Workers workers(plan.threads);
    report = meshes.finish(workers, visit, progress);
  }
  report.bricks = read.bricks;
  report.bricks_read = read.bricks_read;
  report.brick_reads = read.brick_reads;
  report.bytes_read = read.bytes_read;
  report.index_bytes = read.index_bytes;
  report.seconds = read.seconds;
  return report;
}

}  // namespace isobrick

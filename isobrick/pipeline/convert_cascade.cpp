#include "isobrick/pipeline/convert_cascade.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <future>

#include "isobrick/pipeline/downsample.h"

namespace isobrick {

void read_box(VolumeSource& source, Box3 box, std::byte* out) {
  if (!source.random_access()) return source.read(box, out);
  const Int3 e = box.extent();
  const std::size_t plane = static_cast<std::size_t>(e.x * e.y) * size_of(source.info().type);
  // Pieces of a few MiB: long enough for the disk, short enough to share out.
  constexpr std::size_t kPiece = std::size_t{4} << 20;
  const auto planes = std::max<Index>(1, static_cast<Index>(kPiece / plane));
  tbb::parallel_for(Index{0}, ceil_div(e.z, planes), [&](Index i) {
    Box3 piece = box;
    piece.lo.z = box.lo.z + i * planes;
    piece.hi.z = std::min(piece.lo.z + planes, box.hi.z);
    source.read(piece, out + static_cast<std::size_t>(i * planes) * plane);
  });
}

Cascade::Cascade(const ConvertPlan& plan, const StoreLayout& layout, int first_level,
                 std::vector<LevelWriter*> levels)
    // Samples of a file are only a copy away; those of a stream take their time.
    : second_slab_(first_level == 0 && plan.second_slab_fits()) {
  for (std::size_t i = 0; i < levels.size(); ++i) {
    Stage stage;
    stage.lattice = layout.levels[static_cast<std::size_t>(first_level) + i].lattice;
    stage.writer = levels[i];
    stage.capacity = std::min(plan.slab_planes(), stage.lattice.extent.z);
    stage.slab = std::make_unique_for_overwrite<std::byte[]>(
        stage.plane_bytes() * static_cast<std::size_t>(stage.capacity));
    stages_.push_back(std::move(stage));
  }
}

void Cascade::run(VolumeSource& source, Progress& progress) {
  if (!source.random_access() && second_slab_) return run_alternating(source, progress);
  Stage& first = stages_.front();
  const Index end = first.lattice.extent.z;
  while (first.z0 < end) {
    const Index count = std::min(first.capacity, end - first.z0);
    const Box3 box = first.box(count);
    read_box(source, box, first.slab.get());
    Box3 next = box;
    next.lo.z = box.hi.z;
    next.hi.z = std::min(box.hi.z + first.capacity, end);
    if (next.lo.z < next.hi.z) source.will_need(next);
    first.planes = count;
    flush(0);
    progress.advance(first.plane_bytes() * static_cast<std::size_t>(count));
  }
}

void Cascade::run_alternating(VolumeSource& source, Progress& progress) {
  Stage& first = stages_.front();
  const Index end = first.lattice.extent.z;
  auto other = std::make_unique_for_overwrite<std::byte[]>(
      first.plane_bytes() * static_cast<std::size_t>(first.capacity));
  const auto read = [&source](Box3 box, std::byte* out) { source.read(box, out); };
  read(first.box(first.capacity), first.slab.get());
  while (first.z0 < end) {
    first.planes = std::min(first.capacity, end - first.z0);
    Box3 next = first.box(first.planes);
    next.lo.z = next.hi.z;
    next.hi.z = std::min(next.lo.z + first.capacity, end);
    std::future<void> reading;
    if (next.lo.z < next.hi.z)
      reading = std::async(std::launch::async, read, next, other.get());
    const auto bytes = first.plane_bytes() * static_cast<std::size_t>(first.planes);
    flush(0);
    progress.advance(bytes);
    if (reading.valid()) reading.get();
    std::swap(first.slab, other);
  }
}

void Cascade::flush(std::size_t i) {
  Stage& stage = stages_[i];
  const Box3 box = stage.box(stage.planes);
  stage.writer->write(box, stage.slab.get());
  stage.writer->close(box.hi.z);
  if (i + 1 < stages_.size()) {
    Stage& next = stages_[i + 1];
    std::byte* free = next.slab.get() + next.plane_bytes() * static_cast<std::size_t>(next.planes);
    downsample(stage.lattice.type, box.extent(), stage.slab.get(), free);
    next.planes += half_extent(box.extent()).z;
    const bool last = box.hi.z == stage.lattice.extent.z;
    if (last || next.planes == next.capacity) flush(i + 1);
  }
  stage.z0 = box.hi.z;
  stage.planes = 0;
}

}  // namespace isobrick

#include "pipeline/convert/convert_cascade.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <future>

#include "pipeline/convert/downsample.h"

namespace isobrick::inline v0 {

void read_box(VolumeSource& source, Box3 box, std::byte* out) {
  if (!source.parallel()) return source.read(box, out);
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
    : method_(layout.downsampling), second_slab_(first_level == 0 && plan.second_slab_fits()) {
  for (std::size_t i = 0; i < levels.size(); ++i) {
    Stage stage;
    stage.lattice = layout.levels[static_cast<std::size_t>(first_level) + i].lattice;
    stage.writer = levels[i];
    if (i + 1 < levels.size())
      stage.factors = layout.factors[static_cast<std::size_t>(first_level) + i];
    stage.capacity = std::min(plan.slab_planes(), stage.lattice.extent.z);
    stage.slab = std::make_unique_for_overwrite<std::byte[]>(stage.slab_bytes());
    stages_.push_back(std::move(stage));
  }
}

void Cascade::run(VolumeSource& source) {
  Stage& first = stages_.front();
  const auto slab_from = [&](Index z) {
    return intersect(
        {{0, 0, z}, {first.lattice.extent.x, first.lattice.extent.y, z + first.capacity}},
        first.lattice.box());
  };
  // Most files are copied by all threads at once; a stream keeps one thread
  // waiting, so that one fills a second slab meanwhile.
  std::unique_ptr<std::byte[]> other;
  if (!source.parallel() && second_slab_)
    other = std::make_unique_for_overwrite<std::byte[]>(first.slab_bytes());
  Box3 box = slab_from(0);
  read_box(source, box, first.slab.get());
  while (!box.empty()) {
    const Box3 next = slab_from(box.hi.z);
    std::future<void> reading;
    if (!next.empty() && other)
      reading = std::async(std::launch::async, [&] { source.read(next, other.get()); });
    else if (!next.empty())
      source.will_need(next);
    first.planes = box.extent().z;
    flush(0);
    if (reading.valid()) {
      reading.get();
      std::swap(first.slab, other);
    } else if (!next.empty()) {
      read_box(source, next, first.slab.get());
    }
    box = next;
  }
}

void Cascade::flush(std::size_t i) {
  Stage& stage = stages_[i];
  const Box3 box = stage.box();
  Stage* coarser = i + 1 < stages_.size() ? &stages_[i + 1] : nullptr;
  stage.writer->write(box, stage.slab.get(), [&] {
    if (coarser != nullptr)
      downsample(method_, stage.lattice.type, box.extent(), stage.factors, stage.slab.get(),
                 coarser->free_planes());
  });
  stage.writer->record(box.hi.z);
  bool coarser_is_full = false;
  if (coarser != nullptr) {
    coarser->planes += coarser_extent(box.extent(), stage.factors).z;
    const bool last = box.hi.z == stage.lattice.extent.z;
    coarser_is_full = last || coarser->planes == coarser->capacity;
  }
  // Coarse levels have too few bricks to keep all threads busy.
  tbb::parallel_invoke([&] { stage.writer->close(box.hi.z); },
                       [&] {
                         if (coarser_is_full) flush(i + 1);
                       });
  stage.z0 = box.hi.z;
  stage.planes = 0;
}

}  // namespace isobrick

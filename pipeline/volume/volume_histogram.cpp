#include "pipeline/volume/volume_histogram.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/pod_buffer.h>
#include "core/tile.h"
#include "pipeline/index/value_counts.h"

namespace isobrick::inline v0 {
namespace {

/// Edge of the boxes that are read at a time, and samples along x, y, z of those that a thread
/// counts.
constexpr Index kReadEdge = 4 * kTileEdge;
constexpr Int3 kCountedBox{16 * kTileEdge, kTileEdge, kTileEdge};
/// Boxes between two reports of progress.
constexpr std::size_t kBoxesAtOnce = 64;

/// The parts of `edge` samples of a box.
std::vector<Box3> parts_of(Box3 box, Int3 edge) {
  std::vector<Box3> parts;
  for_each_point({{0, 0, 0}, ceil_div(box.extent(), edge)}, [&](Int3 p) {
    const Int3 lo = box.lo + p * edge;
    parts.push_back({lo, min(lo + edge, box.hi)});
  });
  return parts;
}

void count_boxes(const ArraySamples& samples, std::span<const Box3> boxes, ValueCounts& counts) {
  tbb::parallel_for(
      std::size_t{0}, boxes.size(),
      [&](std::size_t i) {
        PodBuffer<std::byte> dense;
        dense.resize(static_cast<std::size_t>(volume(boxes[i].extent())) *
                     samples.lattice().sample_bytes());
        samples.copy(boxes[i], dense.data());
        counts.add(dense.data(), boxes[i], boxes[i]);
      },
      tbb::simple_partitioner());
}

/// Counts samples in memory.
void count_array(const ArraySamples& array, Workers& workers, ValueCounts& counts,
                 Progress& progress) {
  const std::vector<Box3> boxes = parts_of(array.lattice().box(), kCountedBox);
  for (std::size_t i = 0; i < boxes.size(); i += kBoxesAtOnce) {
    const auto some = std::span(boxes).subspan(i, std::min(kBoxesAtOnce, boxes.size() - i));
    workers.execute([&] { count_boxes(array, some, counts); });
    std::uint64_t done = 0;
    for (const Box3& box : some) done += static_cast<std::uint64_t>(volume(box.extent()));
    progress.advance(done * array.lattice().sample_bytes());
  }
}

/// Reads a box while the one before is counted.
void count_read(const VolumeSamples& samples, Workers& workers, ValueCounts& counts,
                Progress& progress) {
  const Lattice& lattice = samples.lattice;
  RegionReader reader(samples.read, samples.concurrent, samples.read_type, workers);
  const std::vector<Box3> boxes = parts_of(lattice.box(), Int3{1, 1, 1} * kReadEdge);
  reader.begin(boxes.front());
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const SampleArray read = reader.take();
    if (i + 1 < boxes.size()) reader.begin(boxes[i + 1]);
    const ArraySamples array(lattice.extent, read, samples.missing, samples.use);
    workers.execute([&] { count_boxes(array, parts_of(boxes[i], kCountedBox), counts); });
    progress.advance(static_cast<std::uint64_t>(volume(boxes[i].extent())) *
                     lattice.sample_bytes());
  }
}

}  // namespace

SampleCounts count_samples(const VolumeSamples& samples, Workers& workers, Progress& progress) {
  const Lattice& lattice = samples.lattice;
  const auto counts = make_value_counts(lattice.type);
  progress.begin("histogram",
                 static_cast<std::uint64_t>(volume(lattice.extent)) * lattice.sample_bytes());
  if (samples.array)
    count_array(*samples.array, workers, *counts, progress);
  else
    count_read(samples, workers, *counts, progress);
  progress.end();
  return counts->counts();
}

}  // namespace isobrick

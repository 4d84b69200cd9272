#include "isobrick/pipeline/export_level_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "isobrick/bricks/level_set.h"
#include "isobrick/core/error.h"
#include "isobrick/core/threshold.h"
#include "isobrick/pipeline/extract.h"
#include "isobrick/pipeline/slab_reader.h"
#include "isobrick/pipeline/stored_bricks.h"
#include "isobrick/pipeline/workers.h"
#include "isobrick/volumes/vdb_level_set.h"

namespace isobrick {
namespace {

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;
/// The extraction is not much faster with more.
constexpr std::uint64_t kExtractBytes = 256 * kMiB;

/// Measures distances from the triangles of a mesh.
class DistanceSink final : public MeshSink {
 public:
  explicit DistanceSink(VdbLevelSet& set) : set_(set) {}

  Indexing indexing() const override { return Indexing::chunk_local; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk& chunk) override { set_.add(chunk.positions, chunk.triangles); }
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }

 private:
  VdbLevelSet& set_;
};

/// Says which samples are inside, brick by brick; only bricks of both kinds are read.
class Signs {
 public:
  Signs(const StoreReader& store, Box3 box, const ExportOptions& options, VdbLevelSet& set)
      : store_(store),
        level_(options.level),
        lattice_(store.info().levels[static_cast<std::size_t>(options.level)].lattice),
        box_(box),
        isovalue_(*options.isovalue),
        below_(options.inside.value_or(inside_of(store.info())) == Inside::below),
        set_(set),
        samples_(lattice_.brick_bytes()),
        inside_(static_cast<std::size_t>(volume(lattice_.brick))) {}

  /// The bricks of `bricks` that the box touches, whose ranges are read together.
  void put(Box3 bricks, Workers& workers) {
    const RangeTable ranges = store_.brick_ranges(level_, bricks);
    for_each_point(bricks, [&](Int3 b) {
      const ValueRange<double>& range = ranges.at(b);
      const bool none_above = range.empty() || range.hi < isovalue_;
      const bool none_below = range.empty() || range.lo >= isovalue_;
      if (below_ ? none_below : none_above) return;
      const Box3 part = intersect(lattice_.brick_box(b), box_);
      const Box3 out{part.lo - box_.lo, part.hi - box_.lo};
      // Ranges say nothing of samples that are no numbers; those are outside.
      if ((below_ ? none_above : none_below) && !store_.info().may_have_nan)
        return set_.put_all_inside(out);
      workers.execute([&] { read_slab(store_, level_, part, samples_.data()); });
      compare(static_cast<std::size_t>(volume(part.extent())));
      set_.put_inside(out, inside_.data());
    });
  }

 private:
  void compare(std::size_t count) {
    visit_scalar(lattice_.type, [&](auto tag) {
      using T = typename decltype(tag)::type;
      const Threshold<T> least(isovalue_);
      const T* samples = reinterpret_cast<const T*>(samples_.data());
      for (std::size_t i = 0; i < count; ++i) {
        const bool above = !least.none && samples[i] >= least.value;
        const bool is_number = samples[i] == samples[i];
        inside_[i] = below_ ? !above && is_number : above;
      }
    });
  }

  const StoreReader& store_;
  int level_;
  Lattice lattice_;
  Box3 box_;
  double isovalue_;
  bool below_;  ///< samples less than the isovalue are inside
  VdbLevelSet& set_;
  std::vector<std::byte> samples_;
  std::vector<std::uint8_t> inside_;
};

}  // namespace

void export_level_set(const StoreReader& store, Box3 box, const VolumeInfo& info,
                      const ExportOptions& options, OutputFile& file, Progress& progress) {
  if (options.half_band < 1 || options.half_band > kWidestHalfBand)
    throw UsageError(fmt::format("a band of {} samples on either side: 1 to {} are possible",
                                 options.half_band, kWidestHalfBand));
  const std::uint64_t for_extraction = std::min(options.memory / 2, kExtractBytes);
  const auto set = make_vdb_level_set_if_built(info, "surface", options.half_band, options.threads,
                                               options.memory - for_extraction);
  DistanceSink sink(*set);
  ExtractOptions extraction;
  extraction.isovalue = *options.isovalue;
  extraction.level = options.level;
  extraction.inside = options.inside;
  extraction.roi = box;
  extraction.memory = for_extraction;
  extraction.threads = options.threads;
  extraction.backend = Backend::cpu;
  extract(store, extraction, sink, progress);

  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(options.level)].lattice;
  Workers workers(options.threads);
  Signs signs(store, box, options, *set);
  const Box3 bricks = lattice.bricks_of(box);
  const auto bytes = [&](Box3 b) {
    return static_cast<std::uint64_t>(volume(b.extent())) * lattice.brick_bytes();
  };
  progress.begin("signs", bytes(bricks));
  for_each_range_file(bricks, [&](Box3 part) {
    signs.put(part, workers);
    progress.advance(bytes(part));
  });
  progress.end();
  set->write(file);
}

}  // namespace isobrick

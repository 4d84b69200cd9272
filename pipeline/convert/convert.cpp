#include <isobrick/convert.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/label_index.h>
#include "bricks/store_writer.h"
#include "core/cancellable_progress.h"
#include "core/stopwatch.h"
#include "io/bytes/output_guard.h"
#include "pipeline/check_part.h"
#include "pipeline/convert/codec_choice.h"
#include "pipeline/convert/convert_cascade.h"
#include "pipeline/convert/convert_join.h"
#include "pipeline/convert/convert_journal.h"
#include "pipeline/convert/convert_level.h"
#include "pipeline/convert/convert_part.h"
#include "pipeline/convert/convert_plan.h"
#include "pipeline/convert/convert_sparse.h"
#include "pipeline/convert/convert_staging.h"
#include "pipeline/convert/display_window.h"
#include "pipeline/convert/downsample.h"
#include "pipeline/slab_file.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {
namespace {

std::size_t bytes_of(Int3 extent, ScalarType type) {
  return static_cast<std::size_t>(volume(extent)) * size_of(type);
}

/// The index that a conversion adds. In its own folder it may replace anything.
IndexOptions index_options(const ConvertOptions& options, bool resume) {
  return {.kind = *options.index,
          .leaf = options.leaf,
          .memory = options.memory,
          .threads = options.threads,
          .resume = resume,
          .force = true};
}

LabelIndexOptions label_index_options(const ConvertOptions& options, bool resume) {
  return {.memory = options.memory, .threads = options.threads, .resume = resume, .force = true};
}

/// Whether the codec is still to be chosen. Throws UsageError for parts, which are made by tasks
/// that know nothing of each other.
bool has_choice(const ConvertOptions& options) {
  if (options.codec != BrickCodec::automatic || options.ome == OmeVersion::v04) return false;
  if (options.part || options.join > 0)
    throw UsageError(
        "parts of a store need the same codec: name zstd, packed or none in place of auto");
  return true;
}

/// Copies a stream to a temporary file beside the store, some planes at a time.
std::unique_ptr<SpooledVolume> spool_stream(VolumeSource& source,
                                            const std::filesystem::path& beside, Index planes,
                                            Progress& progress) {
  const VolumeInfo& info = source.info();
  auto spooled = std::make_unique<SpooledVolume>(beside, info);
  planes = std::min(planes, info.extent.z);
  Box3 box{{0, 0, 0}, {info.extent.x, info.extent.y, 0}};
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(
      bytes_of({info.extent.x, info.extent.y, planes}, info.type));
  progress.begin("spool", bytes_of(info.extent, info.type));
  for (; box.lo.z < info.extent.z; box.lo.z = box.hi.z) {
    box.hi.z = std::min(box.lo.z + planes, info.extent.z);
    source.read(box, buffer.get());
    spooled->write(box, buffer.get());
    progress.advance(bytes_of(box.extent(), info.type));
  }
  progress.end();
  return spooled;
}

/// One conversion into a staging directory.
class Conversion {
 public:
  /// By one of `plan` and `sparse`; the other is null. With `joined` level 0 is there.
  Conversion(VolumeSource& source, const StoreLayout& layout, const ConvertPlan* plan,
             SparsePyramid* sparse, const JoinedParts* joined, ConvertStaging& staging,
             const ConvertOptions& options, Progress& progress)
      : source_(source),
        layout_(layout),
        options_(options),
        plan_(plan),
        sparse_(sparse),
        joined_(joined),
        staging_(staging),
        progress_(progress),
        store_(staging.path(), layout, staging.resumed()),
        journal_(staging.path(), layout.levels.front().lattice, staging.resumed()),
        counts_(make_value_counts(layout.levels.front().lattice.type)) {
    for (int level = 0; plan != nullptr && level < level_count(); ++level)
      writers_.push_back(std::make_unique<LevelWriter>(
          store_, layout, level, plan->bricks_in_flight(), level == 0 ? &journal_ : nullptr,
          level == 0 ? counts_.get() : nullptr, progress));
  }

  ConvertReport run();

 private:
  int level_count() const { return static_cast<int>(layout_.levels.size()); }

  void add_chosen_index(ConvertReport& report);
  void write_levels(int first_level, VolumeSource& source);
  void write_cascade(int first_level, VolumeSource& source);
  std::unique_ptr<SpooledVolume> write_in_pieces(int level, VolumeSource& source);

  VolumeSource& source_;
  const StoreLayout& layout_;
  const ConvertOptions& options_;
  const ConvertPlan* plan_;
  SparsePyramid* sparse_;
  const JoinedParts* joined_;
  ConvertStaging& staging_;
  Progress& progress_;
  StoreWriter store_;
  ConvertJournal journal_;
  std::unique_ptr<ValueCounts> counts_;  ///< of level 0
  std::vector<std::unique_ptr<LevelWriter>> writers_;
};

ConvertReport Conversion::run() {
  ConvertReport report;
  bool has_nan = false;
  if (sparse_ != nullptr) {
    const SparsePyramid::Counts counts =
        sparse_->write(store_, journal_, *counts_, staging_.path(), staging_.resumed(), progress_);
    report.bricks = counts.bricks;
    report.bricks_absent = counts.absent;
    report.bricks_kept = counts.kept;
    has_nan = counts.has_nan;
  } else if (joined_ != nullptr) {
    const JoinedParts::Counts counts = joined_->add_to(store_, *counts_);
    report.bricks = counts.bricks;
    report.bricks_absent = counts.absent;
    has_nan = counts.has_nan;
    if (level_count() > 1) write_levels(1, joined_->coarser());
  } else {
    write_levels(0, source_);
  }
  for (const auto& writer : writers_) {
    report.bricks += writer->counts().bricks;
    report.bricks_absent += writer->counts().absent;
    report.bricks_kept += writer->counts().kept;
    // Infinities of both signs make a NaN that only a coarser level has.
    has_nan |= writer->has_nan();
  }
  store_.put_histogram(counts_->counts());
  // Published while it can still be resumed: a kill in between leaves nothing that the next run
  // does not know. The journal goes last: until then a resume compares the input with it.
  store_.finish(
      has_nan, [&] { return display_window(StoreReader(staging_.path())); },
      [&] {
        add_chosen_index(report);
        staging_.publish(progress_);
      });
  journal_.remove();
  staging_.finish();
  report.bytes_in = bytes_of(source_.info().extent, source_.info().type);
  report.bytes_out = store_.bytes() + report.index_bytes;
  report.levels = level_count();
  return report;
}

void Conversion::add_chosen_index(ConvertReport& report) {
  const auto count = [&](const IndexReport& added) {
    for (const std::uint64_t bytes : added.level_bytes) report.index_bytes += bytes;
    report.index_seconds += added.seconds;
  };
  const fs::path& store = staging_.path();
  const bool resumed = staging_.resumed();
  if (options_.index) count(add_index(store, index_options(options_, resumed), progress_));
  if (options_.label_lists)
    count(add_label_index(store, label_index_options(options_, resumed), progress_));
}

/// `source` is of the first level.
void Conversion::write_levels(int first_level, VolumeSource& source) {
  std::unique_ptr<SpooledVolume> spooled;
  if (!source.random_access() && !plan_->cascade_fits(0))
    spooled = spool_stream(source_, staging_.path(), plan_->spool_planes(), progress_);
  progress_.begin("convert",
                  first_level == 0 ? bytes_of(source.info().extent, source.info().type) : 0);
  for (int level = first_level; level < level_count(); ++level) {
    VolumeSource& of_level = spooled ? static_cast<VolumeSource&>(*spooled) : source;
    if (plan_->cascade_fits(level)) {
      write_cascade(level, of_level);
      break;
    }
    spooled = write_in_pieces(level, of_level);
  }
  progress_.end();
}

void Conversion::write_cascade(int first_level, VolumeSource& source) {
  std::vector<LevelWriter*> writers;
  for (int level = first_level; level < level_count(); ++level)
    writers.push_back(writers_[static_cast<std::size_t>(level)].get());
  Cascade(*plan_, layout_, first_level, writers).run(source);
}

/// Writes a level whose slabs do not fit and leaves the next one in a temporary
/// file; nothing when this is the coarsest.
std::unique_ptr<SpooledVolume> Conversion::write_in_pieces(int level, VolumeSource& source) {
  const Lattice& lattice = layout_.levels[static_cast<std::size_t>(level)].lattice;
  LevelWriter& writer = *writers_[static_cast<std::size_t>(level)];
  std::unique_ptr<SpooledVolume> next;
  Int3 factors{1, 1, 1};
  if (level + 1 < level_count()) {
    factors = layout_.factors[static_cast<std::size_t>(level)];
    VolumeInfo info = source.info();
    info.extent = coarser_extent(lattice.extent, factors);
    next = std::make_unique<SpooledVolume>(staging_.path(), info);
  }
  const Int3 piece = plan_->piece(level);
  const Int3 pieces = ceil_div(lattice.extent, piece);
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(
      bytes_of(min(piece, lattice.extent), lattice.type));
  const auto coarser = std::make_unique_for_overwrite<std::byte[]>(
      next ? bytes_of(coarser_extent(min(piece, lattice.extent), factors), lattice.type) : 0);
  const auto box_of = [&](Int3 p) {
    return intersect({p * piece, (p + Int3{1, 1, 1}) * piece}, lattice.box());
  };
  for_each_point({{0, 0, 0}, pieces}, [&](Int3 p) {
    const Box3 box = box_of(p);
    read_box(source, box, buffer.get());
    writer.write(box, buffer.get(), [&] {
      if (!next) return;
      downsample(layout_.downsampling, lattice.type, box.extent(), factors, buffer.get(),
                 coarser.get());
      next->write({coarser_extent(box.lo, factors), coarser_extent(box.hi, factors)},
                  coarser.get());
    });
    if (p.x + 1 < pieces.x || p.y + 1 < pieces.y) return;
    writer.record(box.hi.z);
    writer.close(box.hi.z);
  });
  return next;
}

}  // namespace

ConvertReport convert(VolumeSource& source, const std::filesystem::path& out,
                      const ConvertOptions& options, Progress& listener) {
  CancellableProgress progress(listener, options.cancel);
  Stopwatch watch;
  const bool choose = has_choice(options);
  StoreLayout layout = plan_layout(source.info(), options, source.sparse());
  std::vector<std::filesystem::path> inputs = options.inputs;
  inputs.insert(inputs.end(), source.info().files.begin(), source.info().files.end());
  if (options.part) {
    check_part(*options.part);
    check_part_output(out, options);
    check_replaces_no_input(out, inputs);
    ConvertReport report = convert_part(source, layout, out, options, progress);
    report.codec = layout.codecs().name();
    report.seconds = watch.lap();
    return report;
  }
  const Lattice& finest = layout.levels.front().lattice;
  const std::uint64_t index_memory =
      options.index ? min_index_memory(index_options(options, false), finest) : 0;
  const int threads = Workers(options.threads).threads();
  const int samplers =
      choose ? sampling_threads(finest, layout.zstd_level, options.memory, threads) : 0;
  std::optional<ConvertPlan> plan;
  std::optional<SparsePyramid> sparse;
  if (options.join == 0 && SparsePyramid::possible(source, layout))
    sparse.emplace(source, layout, options, threads, index_memory);
  else
    plan.emplace(
        layout, options.memory, threads, source.random_access() || options.join > 0,
        source.memory() + (choose ? sampling_bytes(finest, layout.zstd_level, samplers) : 0),
        index_memory);
  if (options.index) check_index_options(index_options(options, false), finest);
  if (options.label_lists) check_label_index_options(label_index_options(options, false), finest);
  std::optional<JoinedParts> joined;
  if (options.join > 0) joined.emplace(layout, out, options.join);
  // What an interrupted join has moved is not in the parts any more.
  ConvertStaging staging(out, options.resume || joined, options.force, std::move(inputs));
  Workers workers(plan ? plan->threads() : sparse->threads());
  std::unique_ptr<SpooledVolume> spooled;
  std::optional<CodecSample> sample;
  ConvertReport report = workers.execute([&] {
    if (choose && staging.resumed()) take_begun_codec(staging.path(), layout);
    // What a stream is like shows at its end only, and it can be read once.
    if (choose && !staging.resumed() && !source.random_access())
      spooled = spool_stream(source, staging.path(), plan->spool_planes(), progress);
    if (choose && !staging.resumed()) {
      sample = sample_source(spooled ? *spooled : source, layout, samplers, options.memory);
      layout.codec = better_codec(*sample, options.packed_factor);
    }
    return Conversion(spooled ? *spooled : source, layout, plan ? &*plan : nullptr,
                      sparse ? &*sparse : nullptr, joined ? &*joined : nullptr, staging, options,
                      progress)
        .run();
  });
  if (joined) joined->remove();
  report.codec = layout.codecs().name();
  report.codec_sample = sample;
  report.seconds = watch.lap();
  return report;
}

}  // namespace isobrick

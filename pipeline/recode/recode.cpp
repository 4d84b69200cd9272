#include <isobrick/recode.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>

#include <isobrick/error.h>
#include <isobrick/pod_buffer.h>
#include "bricks/ranges/brick_checksums.h"
#include "bricks/storage/storage_keys.h"
#include "bricks/store_writer.h"
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/metadata_files.h"
#include "core/cancellable_progress.h"
#include "core/stopwatch.h"
#include "io/bytes/output_guard.h"
#include "pipeline/convert/codec_choice.h"
#include "pipeline/convert/convert_staging.h"
#include "pipeline/histogram/histogram.h"
#include "pipeline/in_order.h"
#include "pipeline/program_memory.h"
#include "pipeline/recode/brick_walk.h"
#include "pipeline/recode/copy_indexes.h"
#include "pipeline/recode/recode_journal.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {
namespace {

/// The layout of the store with another codec, which is zstd while it is to be chosen.
StoreLayout layout_of(const StoreReader& store, const RecodeOptions& options) {
  const StoreInfo& info = store.info();
  const MetadataFiles files = read_metadata_files(*store.storage());
  StoreLayout layout;
  layout.levels = info.levels;
  layout.downsampling = parse_downsampling(files.image.downsampling).value_or(Downsampling::mean);
  layout.ome = files.root == "zarr.json" ? OmeVersion::v05 : OmeVersion::v04;
  layout.codec = options.codec == BrickCodec::automatic ? BrickCodec::zstd : options.codec;
  layout.zstd_level = options.zstd_level;
  layout.fill_value = info.fill_value;
  layout.name = files.image.name;
  layout.grid_class = info.grid_class;
  layout.grid_name = info.grid_name;
  layout.labels = info.labels;
  layout.root = read_small_object(*store.storage(), files.root, kMaxMetadataBytes).value_or("");
  check_codec(options.codec, options.zstd_level, options.packed_factor, layout.ome);
  return layout;
}

/// How many threads and bricks the budget has room for.
struct RecodePlan {
  int threads = 1, bricks_in_flight = 1;
};

std::uint64_t bytes_of(const StoreReader& store, const StoreLayout& layout, bool choose,
                       RecodePlan plan) {
  std::uint64_t brick = 0, gathered = 0, index = 0;
  for (const LevelInfo& level : layout.levels) {
    brick = std::max<std::uint64_t>(brick, level.lattice.brick_bytes());
    gathered = std::max<std::uint64_t>(gathered, brick_checksum_bytes(level));
    index += level.index_bytes;
  }
  const Lattice& finest = layout.levels.front().lattice;
  const std::uint64_t encoder = choose ? sampling_bytes(finest, layout.zstd_level, 1)
                                       : encoder_memory(layout.codecs(), brick);
  // A thread has a brick, its encoded bytes of before, and what it encodes with.
  return kProgramBytes + store.storage()->memory() + gathered + index +
         static_cast<std::uint64_t>(plan.threads) * (brick * 9 / 4 + encoder) +
         static_cast<std::uint64_t>(plan.bricks_in_flight) * (brick * 9 / 8);
}

RecodePlan plan_recode(const StoreReader& store, const StoreLayout& layout, bool choose,
                       const RecodeOptions& options) {
  if (options.threads < 0) throw UsageError(fmt::format("{} threads", options.threads));
  const int threads = Workers(options.threads).threads();
  RecodePlan plan{threads, 2 * threads + 2};
  while (plan.bricks_in_flight > 1 && bytes_of(store, layout, choose, plan) > options.memory) {
    --plan.bricks_in_flight;
    plan.threads = std::min(plan.threads, plan.bricks_in_flight);
  }
  const std::uint64_t least = bytes_of(store, layout, choose, plan);
  if (options.memory >= least) return plan;
  const Int3 brick = layout.levels.front().lattice.brick;
  throw UsageError(fmt::format(
      "a memory budget of {:.1f} MiB is too small: bricks of {} × {} × {} samples need --memory "
      "{}M at least, {} MiB of it for the program and its libraries, the rest for bricks, where "
      "they are found, and encoding them",
      in_mib(options.memory), brick.x, brick.y, brick.z, mib_above(least), kProgramBytes / kMiB));
}

/// One store on its way into a staging directory.
class Recoding {
 public:
  Recoding(const StoreReader& from, const StoredRanges& ranges, const StoreLayout& layout,
           RecodePlan plan, ConvertStaging& staging, Progress& progress)
      : from_(from),
        ranges_(ranges),
        layout_(layout),
        plan_(plan),
        staging_(staging),
        progress_(progress),
        store_(staging.path(), layout, staging.resumed()),
        journal_(staging.path(), to_json(ranges), staging.resumed()) {}

  ConvertReport run();

 private:
  const LevelInfo& level(const MovedBrick& brick) const {
    return layout_.levels[static_cast<std::size_t>(brick.level)];
  }
  void copy_ranges();
  void move_bricks();
  void encode(MovedBrick& brick) const;
  void deliver(const MovedBrick& brick);
  void keep(const MovedBrick& shard);

  const StoreReader& from_;
  const StoredRanges& ranges_;
  const StoreLayout& layout_;
  RecodePlan plan_;
  ConvertStaging& staging_;
  Progress& progress_;
  StoreWriter store_;
  RecodeJournal journal_;
  ConvertReport report_;
};

void Recoding::copy_ranges() {
  for (std::size_t i = 0; i < layout_.levels.size(); ++i)
    store_.copy_ranges(static_cast<int>(i), from_, ranges_.levels[i]);
  if (const auto counts = stored_counts(from_)) store_.put_histogram(*counts);
}

void Recoding::encode(MovedBrick& brick) const {
  if (brick.kept) return;
  const Lattice& lattice = level(brick).lattice;
  thread_local PodBuffer<std::byte> samples;
  samples.resize(lattice.brick_bytes());
  if (from_.read_brick(brick.level, brick.brick, samples.data()))
    brick.encoded = encode_brick(lattice, samples.span(), layout_.fill_value, layout_.codecs());
}

void Recoding::keep(const MovedBrick& shard) {
  const LevelInfo& info = level(shard);
  store_.keep_shard(shard.level, shard.shard);
  const Box3 samples = intersect(
      {shard.shard * info.shard, (shard.shard + Int3{1, 1, 1}) * info.shard}, info.lattice.box());
  const auto bricks =
      static_cast<std::uint64_t>(volume(ceil_div(samples.extent(), info.lattice.brick)));
  report_.bricks += bricks;
  report_.bricks_kept += bricks;
  progress_.advance(static_cast<std::uint64_t>(volume(samples.extent())) *
                    info.lattice.sample_bytes());
}

void Recoding::deliver(const MovedBrick& brick) {
  if (brick.kept) return keep(brick);
  const Lattice& lattice = level(brick).lattice;
  ++report_.bricks;
  if (brick.encoded)
    store_.put(brick.level, brick.brick, *brick.encoded);
  else
    ++report_.bricks_absent;
  if (brick.last) store_.finish_shard(brick.level, brick.shard);
  progress_.advance(static_cast<std::uint64_t>(volume(lattice.brick_box(brick.brick).extent())) *
                    lattice.sample_bytes());
}

void Recoding::move_bricks() {
  std::uint64_t total = 0;
  for (const LevelInfo& level : layout_.levels)
    total +=
        static_cast<std::uint64_t>(volume(level.lattice.extent)) * level.lattice.sample_bytes();
  progress_.begin("recode", total);
  BrickWalk walk(from_, layout_, store_);
  run_in_order<MovedBrick>(
      static_cast<std::size_t>(plan_.bricks_in_flight),
      [&](MovedBrick& brick) { return walk.next(brick); },
      [&](MovedBrick& brick) { encode(brick); }, [&](const MovedBrick& brick) { deliver(brick); });
  progress_.end();
}

ConvertReport Recoding::run() {
  copy_ranges();
  move_bricks();
  // Published while it can still be resumed; the journal goes last, as in a conversion.
  store_.finish(ranges_.may_have_nan, nullptr, [&] {
    report_.index_bytes = copy_indexes(from_, staging_.path(), progress_);
    staging_.publish(progress_);
  });
  journal_.remove();
  staging_.finish();
  const Lattice& finest = layout_.levels.front().lattice;
  report_.bytes_in = static_cast<std::uint64_t>(volume(finest.extent)) * finest.sample_bytes();
  report_.bytes_out = store_.bytes() + report_.index_bytes;
  report_.levels = static_cast<int>(layout_.levels.size());
  report_.codec = layout_.codecs().name();
  return report_;
}

StoredRanges ranges_of(const StoreReader& store) {
  const StoreInfo& info = store.info();
  if (!info.ours)
    throw UsageError(fmt::format(
        "'{}' was written by another program; 'isobrick convert' makes a store of it, by any codec",
        info.name));
  const auto ranges = read_stored_ranges(*store.storage(), info.additions);
  for (std::size_t level = 0; level < info.levels.size(); ++level)
    if (!ranges || !store.has_ranges(static_cast<int>(level)))
      throw Error(fmt::format("level {} of '{}' has no ranges; run: {}", level, info.name,
                              index_command(info)));
  return *ranges;
}

}  // namespace

ConvertReport recode(const StoreReader& reader, const std::filesystem::path& out,
                     const RecodeOptions& options, Progress& listener) {
  const StoreReader store = reader.native();
  CancellableProgress progress(listener, options.cancel);
  Stopwatch watch;
  const StoredRanges ranges = ranges_of(store);
  StoreLayout layout = layout_of(store, options);
  const bool choose = options.codec == BrickCodec::automatic && layout.ome == OmeVersion::v05;
  const RecodePlan plan = plan_recode(store, layout, choose, options);
  const std::array<std::filesystem::path, 1> inputs{store.storage()->local_path()};
  check_replaces_no_input(out, inputs);
  ConvertStaging staging(out, options.resume, options.force, {inputs.begin(), inputs.end()});
  std::optional<CodecSample> sample;
  Workers workers(plan.threads);
  ConvertReport report = workers.execute([&] {
    if (choose && staging.resumed()) {
      take_begun_codec(staging.path(), layout);
    } else if (choose) {
      sample = sample_codecs(store, options.zstd_level, plan.threads);
      layout.codec = better_codec(*sample, options.packed_factor);
    }
    return Recoding(store, ranges, layout, plan, staging, progress).run();
  });
  report.codec_sample = sample;
  report.seconds = watch.lap();
  return report;
}

CodecSample sample_codecs(const StoreReader& reader, int zstd_level, int threads) {
  const StoreReader store = reader.native();
  const StoreInfo& info = store.info();
  Workers workers(threads);
  return workers.execute([&] {
    return sample_bricks(
        info.levels.front().lattice, info.fill_value, zstd_level,
        [&](Int3 b, std::span<std::byte> out) { return store.read_brick(0, b, out.data()); });
  });
}

}  // namespace isobrick

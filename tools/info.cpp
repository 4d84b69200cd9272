#include <filesystem>
#include <map>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include <isobrick/recode.h>
#include <isobrick/store_reader.h>
#include "bricks/stored_index.h"
#include "bricks/zarr/label_metadata.h"
#include "bricks/zarr/metadata_files.h"
#include "io/bytes/folder_walk.h"
#include "pipeline/convert/codec_choice.h"
#include "pipeline/workers.h"
#include "tools/codec_report.h"
#include "tools/format.h"
#include "tools/histogram.h"
#include "tools/info_source.h"
#include "tools/info_volumes.h"
#include "tools/input.h"
#include "tools/label_report.h"
#include "tools/open_store.h"
#include "tools/value_range.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct InfoArguments {
  InputArguments input;
  bool stats = false;
  std::uint64_t memory = 0;
  int threads = 0;
};

/// Of a store in a folder or a zip.
std::uint64_t bytes_of(const fs::path& path) {
  if (!fs::is_directory(path)) return fs::file_size(path);
  std::uint64_t bytes = 0;
  walk_folder(path, [&](const fs::path& file, fs::file_type type) {
    if (type == fs::file_type::regular) bytes += fs::file_size(path / file);
    return true;
  });
  return bytes;
}

/// Columns of the drawing.
constexpr int kColumns = 64;
/// Bricks of a level that are looked for: seconds.
constexpr Index kMaxBricks = Index{1} << 26;

/// Bricks of a level that are stored, counted shard by shard; nothing where there are too many to
/// look for.
std::optional<std::uint64_t> stored_bricks(const StoreReader& store, int level) {
  const LevelInfo& info = store.info().levels[static_cast<std::size_t>(level)];
  const Box3 all{{0, 0, 0}, info.lattice.bricks()};
  if (volume(all.hi) > kMaxBricks ||
      volume(ceil_div(info.lattice.extent, info.shard)) > kMaxLookups)
    return std::nullopt;
  const Int3 shard = ceil_div(info.shard, info.lattice.brick);
  std::uint64_t stored = 0;
  for_each_point({{0, 0, 0}, ceil_div(all.hi, shard)}, [&](Int3 s) {
    for_each_point(intersect({s * shard, (s + Int3{1, 1, 1}) * shard}, all),
                   [&](Int3 b) { stored += store.locate(level, b).has_value() ? 1 : 0; });
  });
  return stored;
}

/// A kind of index, and what it takes in each level that has it: nullopt without --stats.
struct IndexFacts {
  std::string kind;
  Index leaf = 0;  ///< of the finest of these levels
  std::map<int, std::optional<std::uint64_t>> level_bytes;

  std::optional<std::uint64_t> bytes() const {
    std::uint64_t sum = 0;
    for (const auto& [level, bytes] : level_bytes) {
      if (!bytes) return std::nullopt;
      sum += *bytes;
    }
    return sum;
  }
};

std::vector<IndexFacts> indexes_of(const StoreReader& store, bool stats) {
  std::map<std::string, IndexFacts> kinds;
  for (int level = 0; level < static_cast<int>(store.info().levels.size()); ++level)
    for (const std::string& kind : stored_index_kinds(store, level)) {
      const StoredIndex index(store, level, kind);
      IndexFacts& facts = kinds[kind];
      if (facts.level_bytes.empty()) facts.leaf = index.layout().leaf;
      facts.kind = kind;
      facts.level_bytes[level] = stats ? std::optional(index.bytes()) : std::nullopt;
    }
  std::vector<IndexFacts> list;
  for (auto& [kind, facts] : kinds) list.push_back(std::move(facts));
  return list;
}

/// All that `info` reports, gathered before anything is written. What takes longer the larger the
/// store is comes only with --stats.
struct StoreFacts {
  bool stats = false;
  std::optional<std::uint64_t> bytes;
  std::uint64_t raw_bytes = 0;
  std::vector<std::optional<std::uint64_t>> stored;  ///< bricks, a level
  bool has_ranges = false;
  std::optional<ValueRange<double>> range;
  std::optional<Histogram> histogram;
  std::string no_histogram;  ///< why there is none
  std::vector<IndexFacts> indexes;
  std::vector<std::string> label_images;  ///< in its group `labels`
  std::optional<CodecSample> codec_sample;
  std::string codec_advice;  ///< empty without --stats

  std::optional<double> ratio() const {
    if (!bytes) return std::nullopt;
    return static_cast<double>(raw_bytes) / static_cast<double>(*bytes);
  }
};

/// Of a store that keeps no histogram.
void read_values(const StoreReader& store, std::uint64_t memory, Progress& progress,
                 StoreFacts& facts) {
  if (facts.has_ranges) facts.range = value_range(store, 0);
  facts.no_histogram = why_no_histogram(store, memory);
  if (facts.no_histogram.empty()) facts.histogram = histogram(store, progress);
}

/// Of larger bricks even a few are many bytes.
constexpr std::size_t kMaxSampledBrick = std::size_t{64} << 20;

/// Damage is for `verify` to report.
void compare_codecs(const StoreReader& store, const InfoArguments& arguments, StoreFacts& facts) {
  const Lattice& lattice = store.info().levels.front().lattice;
  if (lattice.brick_bytes() > kMaxSampledBrick) return;
  constexpr int kLevel = 3;
  const int threads =
      sampling_threads(lattice, kLevel, arguments.memory, Workers(arguments.threads).threads());
  try {
    facts.codec_sample = sample_codecs(store, kLevel, threads);
    facts.codec_advice = codec_advice(store, arguments.input.path, *facts.codec_sample);
  } catch (const DamageError&) {
  }
}

StoreFacts gather(const StoreReader& store, const InfoArguments& arguments, Progress& progress) {
  const bool stats = arguments.stats;
  const StoreInfo& info = store.info();
  const Lattice& finest = info.levels.front().lattice;
  StoreFacts facts;
  facts.stats = stats;
  facts.raw_bytes = static_cast<std::uint64_t>(volume(finest.extent)) * finest.sample_bytes();
  facts.stored.resize(info.levels.size());
  facts.has_ranges = store.has_ranges(0);
  facts.indexes = indexes_of(store, stats);
  facts.label_images = label_image_names(*store.storage());
  if (stats) {
    if (const fs::path place = store.storage()->local_path(); !place.empty())
      facts.bytes = bytes_of(place);  // behind a URL nobody counts them
    for (std::size_t i = 0; i < facts.stored.size(); ++i)
      facts.stored[i] = stored_bricks(store, static_cast<int>(i));
  }
  if (const auto stored = stored_histogram(store)) {
    facts.range = {stored->lo, stored->hi};
    facts.histogram = rebin(*stored, kColumns);
  } else if (stats) {
    read_values(store, arguments.memory, progress, facts);
  }
  if (stats) compare_codecs(store, arguments, facts);
  return facts;
}

template <class T>
ordered_json json_or_null(const std::optional<T>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json levels_json(const StoreInfo& info, const StoreFacts& facts) {
  ordered_json levels = ordered_json::array();
  for (std::size_t i = 0; i < info.levels.size(); ++i) {
    const LevelInfo& level = info.levels[i];
    levels.push_back({{"extent", to_json(level.lattice.extent)},
                      {"spacing", to_json(level.transform.spacing)},
                      {"brick", to_json(level.lattice.brick)},
                      {"shard", to_json(level.shard)},
                      {"bricks", volume(level.lattice.bricks())},
                      {"bricks_stored", json_or_null(facts.stored[i])}});
  }
  return levels;
}

ordered_json histogram_json(const Histogram& h) {
  return {{"level", h.level},         {"lo", h.lo},         {"hi", h.hi},
          {"bin_width", h.bin_width}, {"counts", h.counts}, {"not_a_number", h.not_a_number},
          {"infinite", h.infinite}};
}

ordered_json indexes_json(const StoreFacts& facts) {
  ordered_json indexes = ordered_json::array();
  for (const IndexFacts& index : facts.indexes) {
    ordered_json levels = ordered_json::array();
    for (const auto& [level, bytes] : index.level_bytes)
      levels.push_back({{"level", level}, {"bytes", json_or_null(bytes)}});
    indexes.push_back({{"kind", index.kind},
                       {"leaf", index.leaf},
                       {"bytes", json_or_null(index.bytes())},
                       {"levels", std::move(levels)}});
  }
  return indexes;
}

ordered_json json_of(const std::string& path, const StoreInfo& info, const StoreFacts& facts) {
  const LevelInfo& finest = info.levels.front();
  ordered_json object{
      {"command", "info"},
      {"input", path},
      {"format", info.ours ? "store" : "Zarr"},
      {"extent", to_json(finest.lattice.extent)},
      {"type", zarr_name(info.stored_type)},
      {"spacing", to_json(finest.transform.spacing)},
      {"origin", to_json(finest.transform.origin)},
      {"direction", finest.transform.direction},
      {"unit", finest.transform.unit},
      {"codec", info.codec},
      {"codec_sample", codec_sample_json(facts.codec_sample)},
      {"codec_advice",
       facts.codec_advice.empty() ? ordered_json(nullptr) : ordered_json(facts.codec_advice)},
      {"fill_value", to_json(info.fill_value)},
      {"grid_class", info.grid_class},
      {"grid_name", info.grid_name},
      {"labels", labels_json(info.labels)},
      {"label_images", facts.label_images},
      {"levels", levels_json(info, facts)},
      {"bytes", json_or_null(facts.bytes)},
      {"raw_bytes", facts.raw_bytes},
      {"ratio", json_or_null(facts.ratio())},
      {"value_range", nullptr},
      {"histogram", facts.histogram ? histogram_json(*facts.histogram) : ordered_json(nullptr)},
      {"peak_resident_bytes", peak_resident_bytes()},
      {"index_kinds", ordered_json::array()},
      {"indexes", indexes_json(facts)}};
  for (const IndexFacts& index : facts.indexes) object["index_kinds"].push_back(index.kind);
  if (facts.range && !facts.range->empty())
    object["value_range"] = {facts.range->lo, facts.range->hi};
  return object;
}

std::string levels_text(const StoreInfo& info, const StoreFacts& facts) {
  std::string text;
  for (std::size_t i = 0; i < info.levels.size(); ++i) {
    const Lattice& lattice = info.levels[i].lattice;
    const auto bricks = static_cast<std::uint64_t>(volume(lattice.bricks()));
    const auto stored = facts.stored[i];
    text += fmt::format("level {:<6} {}; bricks of {}: {}", i, human_extent(lattice.extent),
                        human_extent(lattice.brick), human_count(bricks));
    if (stored)
      text += fmt::format(", {} absent", human_count(bricks - *stored));
    else if (facts.stats)
      text += ", too many to look for the absent ones";
    text += '\n';
  }
  return text;
}

std::string indexes_text(const StoreFacts& facts) {
  if (facts.indexes.empty()) return "index kinds  none\n";
  std::string text;
  for (const IndexFacts& index : facts.indexes) {
    std::vector<std::string> levels;
    for (const auto& [level, bytes] : index.level_bytes)
      if (bytes) levels.push_back(fmt::format("level {} {}", level, human_bytes(*bytes)));
    text +=
        fmt::format("{:<13}{}, leaf {}", text.empty() ? "index kinds" : "", index.kind, index.leaf);
    if (const auto bytes = index.bytes())
      text += fmt::format(": {} ({})", human_bytes(*bytes), fmt::join(levels, ", "));
    text += '\n';
  }
  return text;
}

std::string codec_text(const StoreInfo& info, const StoreFacts& facts) {
  std::string text = fmt::format("codec        {}", info.codec);
  if (!facts.codec_advice.empty()) text += "; " + facts.codec_advice;
  return text + '\n';
}

std::string bytes_text(const StoreFacts& facts) {
  if (!facts.bytes && facts.stats)
    return fmt::format("bytes        unknown behind a URL, for {} of samples\n",
                       human_bytes(facts.raw_bytes));
  if (!facts.bytes)
    return fmt::format("bytes        with --stats, for {} of samples\n",
                       human_bytes(facts.raw_bytes));
  return fmt::format("bytes        {} for {} of samples ({:.2f} to 1)\n", human_bytes(*facts.bytes),
                     human_bytes(facts.raw_bytes), *facts.ratio());
}

std::string range_text(const StoreInfo& info, const StoreFacts& facts) {
  if (!facts.histogram && !facts.has_ranges)
    return fmt::format("value range  unknown; run: {}\n", index_command(info));
  if (!facts.range) return "value range  with --stats\n";
  if (facts.range->empty()) return "value range  none\n";
  return fmt::format("value range  {} to {}\n", sample_text(facts.range->lo, info.type),
                     sample_text(facts.range->hi, info.type));
}

std::string histogram_text(const StoreInfo& info, const StoreFacts& facts) {
  if (!facts.histogram && !facts.stats) return "histogram    with --stats\n";
  if (!facts.histogram) return fmt::format("histogram    none: {}\n", facts.no_histogram);
  const Histogram& h = *facts.histogram;
  std::string text = fmt::format("histogram    of level {}, square-root scale\n{}", h.level,
                                 draw(h, 6, info.type));
  if (h.not_a_number + h.infinite > 0)
    text += fmt::format("  left out: {} NaN, {} infinite\n", human_count(h.not_a_number),
                        human_count(h.infinite));
  return text;
}

std::string text_of(const std::string& path, const StoreInfo& info, const StoreFacts& facts) {
  std::string text = fmt::format("{:<13}{}\n", info.ours ? "store" : "image", path);
  text +=
      fmt::format("extent       {} samples of {}\n",
                  human_extent(info.levels.front().lattice.extent), zarr_name(info.stored_type));
  text += place_text(info.levels.front().transform);
  if (!info.grid_name.empty()) text += fmt::format("grid         {}\n", info.grid_name);
  if (!info.grid_class.empty()) text += fmt::format("grid class   {}\n", info.grid_class);
  text += labels_text(info.labels);
  if (!facts.label_images.empty())
    text += fmt::format("label images {}\n", fmt::join(facts.label_images, ", "));
  text += levels_text(info, facts);
  text += codec_text(info, facts);
  text += bytes_text(facts) + range_text(info, facts) + indexes_text(facts);
  return text + histogram_text(info, facts);
}

void report(const StoreReader& store, const InfoArguments& arguments, Console& console) {
  const StoreFacts facts = gather(store, arguments, console.progress());
  const std::string& path = arguments.input.path;
  console.result(json_of(path, store.info(), facts), text_of(path, store.info(), facts));
}

int run_info(const InfoArguments& arguments, Console& console) {
  const InputArguments& input = arguments.input;
  check_input(input.path);
  if (is_zarr(input.path)) {
    // Whatever it lacks: nothing is converted.
    const auto storage = open_input_storage(input, console);
    if (!list_volumes(input.path, *storage, input.volume.selection, console))
      report(StoreReader(storage, input.volume.selection), arguments, console);
  } else if (!arguments.stats) {
    report_source(input, console);
  } else {
    report(open_input(input, arguments.memory, arguments.threads, console).store(), arguments,
           console);
  }
  return 0;
}

}  // namespace

void add_info(Program& program) {
  auto arguments = std::make_shared<InfoArguments>();
  CLI::App* app = add_subcommand(
      program, "info",
      "Show what a volume is: extents, levels, bricks, histogram; or which channels and times.",
      "isobrick info head.zarr");
  add_input(app, arguments->input);
  add_flag(app, "--stats", arguments->stats,
           "Also what takes longer the larger the volume is: bytes, absent bricks, and the "
           "values of a volume that keeps no histogram");
  add_memory(app, arguments->memory);
  add_threads(app, arguments->threads);
  add_run(program, app, arguments, run_info);
}

}  // namespace isobrick::tools

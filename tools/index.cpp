#include <algorithm>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include <isobrick/index_build.h>
#include <isobrick/label_index.h>
#include <isobrick/store_reader.h>
#include "bricks/ranges/index_layout.h"
#include "core/stopwatch.h"
#include "tools/format.h"
#include "tools/index_options.h"
#include "tools/interrupt.h"
#include "tools/job.h"
#include "tools/open_store.h"

namespace isobrick::tools {
namespace {

struct IndexArguments {
  std::string store;
  IndexOptions index;
  bool has_labels = false;  ///< lists of labels in place of index.kind
  bool mpi = true;          ///< the ranks of a job share the work
};

/// Samples of a part that ranks share. By the volume alone, so that the next run finds the same
/// parts.
constexpr std::uint64_t kIndexPartSamples = std::uint64_t{256} * 256 * 256;
constexpr std::uint64_t kMostIndexParts = 1024;

std::uint64_t total(const IndexReport& report) {
  std::uint64_t bytes = 0;
  for (const std::uint64_t of_level : report.level_bytes) bytes += of_level;
  return bytes;
}

std::string kind_of(const IndexArguments& arguments) {
  return std::string(arguments.has_labels ? kLabelIndex : name_of(arguments.index.kind));
}

Index leaf_of(const IndexArguments& arguments) {
  return arguments.has_labels ? kLabelLeaf : arguments.index.leaf;
}

std::string text_of(const IndexArguments& arguments, const IndexReport& report) {
  if (const auto& part = arguments.index.part) {
    std::string text =
        fmt::format("{}: part {} of {} of the {} index with leaf {}, in {}", arguments.store,
                    part->number, part->count, name_of(arguments.index.kind), arguments.index.leaf,
                    human_seconds(report.seconds));
    if (report.chunks_kept > 0)
      text += fmt::format(" ({} of {} files kept)", human_count(report.chunks_kept),
                          human_count(report.chunks));
    if (report.chunks == 0 && !report.ranges_added)
      text += "\nthere is nothing to do before --join: ranges alone make this index";
    return text + '\n';
  }
  const std::size_t levels = report.level_bytes.size();
  std::string text =
      fmt::format("{}: {} index with leaf {} of {} level{}, {} in {}", arguments.store,
                  kind_of(arguments), leaf_of(arguments), levels, levels == 1 ? "" : "s",
                  human_bytes(total(report)), human_seconds(report.seconds));
  if (report.chunks_kept > 0)
    text += fmt::format(" ({} of {} files kept)", human_count(report.chunks_kept),
                        human_count(report.chunks));
  if (report.ranges_added)
    text += fmt::format("\nranges computed first, in {}", human_seconds(report.range_seconds));
  return text + '\n';
}

/// The ranks make all parts, and the first one joins them.
IndexReport index_by_ranks(const std::string& store, IndexOptions options, Ranks& job,
                           Console& console) {
  const auto samples = static_cast<std::uint64_t>(
      volume(StoreReader(store, options.selection).info().levels.front().lattice.extent));
  const auto parts = static_cast<std::uint32_t>(std::clamp<std::uint64_t>(
      (samples + kIndexPartSamples - 1) / kIndexPartSamples, 1, kMostIndexParts));
  share_machine(job, options.memory, options.threads);
  IndexReport report;
  double seconds = 0;
  {
    const Stopwatch watch(seconds);
    deal(job, parts, [&](std::uint64_t i) {
      options.part = Part{static_cast<std::uint32_t>(i + 1), parts};
      add_index(store, options, console.progress());
    });
    job.wait_for_all();
    options.part.reset();
    options.join = parts;
    if (job.rank() == 0) report = add_index(store, options, console.progress());
    job.wait_for_all();
  }
  report.seconds = seconds;
  return report;
}

/// Lists of labels, which one process makes: of a job the first rank.
IndexReport index_labels(const IndexArguments& arguments, Ranks* job, Console& console) {
  const IndexOptions& options = arguments.index;
  if (options.part || options.join > 0)
    throw UsageError("--kind labels has no parts: leave out --part and --join");
  if (options.leaf != kDefaultLeaf)
    throw UsageError("--kind labels has lists of 32 cells along each edge: leave out --leaf");
  IndexReport report;
  if (job == nullptr || job->rank() == 0)
    report = add_label_index(arguments.store,
                             {.selection = options.selection,
                              .memory = options.memory,
                              .threads = options.threads,
                              .resume = options.resume,
                              .force = options.force},
                             console.progress());
  if (job != nullptr) job->wait_for_all();
  return report;
}

int run_index(const IndexArguments& arguments, Console& console) {
  check_store(arguments.store);
  const IndexOptions& options = arguments.index;
  const bool is_whole = !options.part && options.join == 0;
  Ranks* const job = is_whole ? join_job(arguments.mpi, console) : nullptr;
  if (is_whole && job == nullptr)
    set_interrupt_note([] { return "the same command with --resume goes on with what is done"; });
  else
    set_interrupt_note([] { return "the same command goes on with what is done"; });
  const IndexReport report = arguments.has_labels ? index_labels(arguments, job, console)
                             : job != nullptr
                                 ? index_by_ranks(arguments.store, options, *job, console)
                                 : add_index(arguments.store, options, console.progress());
  nlohmann::ordered_json object{{"command", "index"},
                                {"input", arguments.store},
                                {"kind", kind_of(arguments)},
                                {"leaf", leaf_of(arguments)}};
  if (options.part)
    object["part"] = {{"number", options.part->number}, {"count", options.part->count}};
  object["bytes"] = total(report);
  object["level_bytes"] = report.level_bytes;
  object["files"] = {{"total", report.chunks}, {"kept", report.chunks_kept}};
  object["ranges_added"] = report.ranges_added;
  object["seconds"] = {{"total", report.seconds}, {"ranges", report.range_seconds}};
  add_peak(job, object);
  console.result(object, text_of(arguments, report));
  return 0;
}

}  // namespace

void add_index(Program& program) {
  auto arguments = std::make_shared<IndexArguments>();
  CLI::App* app = add_subcommand(
      program, "index",
      "Add a search structure to a store, and the ranges of samples that another program's image "
      "lacks.",
      "isobrick index head.zarr --kind octree");
  add_path(app, "STORE", arguments->store,
           "Store to add to, or another program's Zarr image or array");
  add_text(app,
           {"--kind", "interval|kdtree|quadtree|octree|labels",
            "Which structure; labels: lists of the labels in each brick of a label image, for "
            "'isobrick extract --labels' of some of them",
            "octree"},
           [arguments = arguments.get()](const std::string& text) {
             arguments->has_labels = text == kLabelIndex;
             if (!arguments->has_labels) arguments->index.kind = parse_stored_kind(text);
           });
  add_selection(app, arguments->index.selection);
  add_leaf(app, arguments->index.leaf);
  add_memory(app, arguments->index.memory);
  add_threads(app, arguments->index.threads);
  add_flag(app, "--resume", arguments->index.resume, "Go on with an interrupted build");
  add_flag(app, "-f,--force", arguments->index.force,
           "Replace an index of this kind, once the new one is whole, and compute the ranges of "
           "another program's image anew");
  add_parsed(
      app, arguments->index.part,
      [](const std::string& text) { return std::optional(parse_part(text)); },
      {"--part", "I/N",
       "Compute only part I of N, beside the store in STORE.index.parts; what is whole there is "
       "kept"});
  add_parsed(app, arguments->index.join,
             [](const std::string& text) {
               return static_cast<std::uint32_t>(parse_int(text, 1, kMaxParts));
             },
             {"--join", "N", "Make the index of all N parts, which are there; reads no samples"});
  add_mpi(app, arguments->mpi);
  add_run(program, app, arguments, run_index);
}

}  // namespace isobrick::tools

#include "tools/extract_labels.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <map>
#include <mutex>

#include <fmt/format.h>
#include <tbb/info.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "io/bytes/folder_output.h"
#include "io/bytes/folder_walk.h"
#include "io/bytes/output_file.h"
#include "io/bytes/output_guard.h"
#include "io/meshes/levels/level_folder.h"
#include "pipeline/program_memory.h"
#include "tools/format.h"
#include "tools/label_report.h"
#include "tools/measure_report.h"
#include "tools/mesh_output.h"
#include "tools/output_name.h"
#include "tools/store_region.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// The list of the meshes, in their folder.
constexpr std::string_view kListName = "labels.json";

std::int64_t parse_label(std::string_view text) {
  std::int64_t label = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), label);
  if (text.empty() || failure != std::errc() || end != text.data() + text.size())
    throw UsageError(fmt::format(
        "'{}' is no label; --labels takes all, or whole numbers and ranges such as 3,7,10:20",
        text));
  return label;
}

/// Whether a file may be part of an output: a mesh of a label, or the list.
bool is_own_name(std::string_view name) {
  if (name == kListName || is_level_file(name)) return true;
  const std::size_t dot = name.find('.');
  if (dot == name.npos || !find_mesh_format(name.substr(dot))) return false;
  std::string_view label = name.substr(0, dot);
  if (label.starts_with('-')) label.remove_prefix(1);
  return !label.empty() && label.find_first_not_of("0123456789") == label.npos;
}

/// The format of the meshes.
MeshFormat format_of(const ExtractArguments& arguments) {
  if (arguments.format) return *arguments.format;
  const auto of_name = find_mesh_format(without_slash(arguments.output).extension().string());
  return of_name && has_levels(*of_name) ? *of_name : MeshFormat::ply;
}

/// Options that say how an isosurface is made.
void check_label_arguments(const ExtractArguments& arguments) {
  const std::pair<bool, const char*> of_isosurfaces[] = {
      {!arguments.isovalues.empty(), "--isovalue"},
      {!arguments.preview.path.empty(), "--preview"},
      {arguments.estimate, "--estimate"},
      {!arguments.attributes.empty(), "--attribute"},
      {!arguments.colours.attribute.empty(), "--colour-by"},
      {arguments.cap, "--cap"},
      {arguments.for_print, "--preset"},
      {arguments.drop_degenerate, "--drop-degenerate"},
      {arguments.topology != Topology::consistent, "--topology"},
      {arguments.inside.has_value(), "--inside"},
      {arguments.normals == std::optional(true), "--normals"},
      {arguments.max_triangles || !arguments.level, "--max-triangles"},
      {arguments.backend == Backend::cuda, "--backend cuda"}};
  for (const auto& [is_given, name] : of_isosurfaces)
    if (is_given)
      throw UsageError(
          fmt::format("{} is for isosurfaces, and --labels makes other meshes: leave out one of "
                      "them",
                      name));
  check_filters(arguments.filters, false);
  if (is_standard_output(arguments.output))
    throw UsageError("standard output takes one mesh, and each label has one: name a folder");
  refuse_url_output(arguments.output);
  if (arguments.format == MeshFormat::pvtp)
    throw UsageError("PVTP has several files for a mesh; choose another --format for labels");
  if (arguments.quantize && arguments.format != MeshFormat::glb)
    throw UsageError("--quantize is for GLB only: add --format glb");
  if (arguments.compress && arguments.format != MeshFormat::glb)
    throw UsageError("--compress is for GLB only: add --format glb");
  check_levels(
      {.format = format_of(arguments), .levels = arguments.levels, .sharded = arguments.sharded});
}

std::string folder_name(const ExtractArguments& arguments) {
  if (arguments.output.empty())
    return stem_of_input(arguments.input.path, arguments.input.volume) + "_labels";
  const MeshFormat format = format_of(arguments);
  const std::string_view own = extension_of(format);
  refuse_misleading_name(arguments.output,
                         std::span(&own, has_levels(format) ? std::size_t{1} : std::size_t{0}),
                         "--labels writes a folder with a mesh for each label");
  return arguments.output;
}

/// How the budget is divided while meshes are written.
struct VisitPlan {
  int visits = 1;                ///< at the same time
  std::uint64_t mesh_bytes = 0;  ///< of each, for its file
  std::uint64_t filter_bytes = 0;
};

VisitPlan plan_visits(const ExtractArguments& arguments, const MeshFilterOptions& filter) {
  constexpr std::uint64_t buffers = 3 * kMiB, least = 8 * kMiB, simplification = 120 * kMiB;
  const int threads = arguments.threads > 0 ? arguments.threads : tbb::info::default_concurrency();
  std::uint64_t each = buffers + least;
  if (filter.any()) each += least;
  if (filter.simplifies()) each += simplification;
  if (has_levels(format_of(arguments)) || arguments.compress)
    each +=
        memory_of_file({.format = format_of(arguments), .compress = arguments.compress}, 1, least);
  // A quarter of the budget is that of the labels.
  const std::uint64_t budget =
      arguments.memory - arguments.memory / 4 - std::min(arguments.memory / 4, kProgramBytes);
  const bool is_compressed = arguments.compress;
  if ((has_levels(format_of(arguments)) || is_compressed) && budget < each)
    throw UsageError(
        fmt::format("a memory budget of {:.1f} MiB is too small for {}: at least --memory {}M is "
                    "needed",
                    in_mib(arguments.memory), is_compressed ? "--compress" : "levels of detail",
                    mib_above((each + kProgramBytes) / 3 * 4)));
  VisitPlan plan;
  plan.visits = static_cast<int>(
      std::clamp<std::uint64_t>(budget / each, 1, static_cast<std::uint64_t>(threads)));
  const std::uint64_t spare =
      budget / static_cast<std::uint64_t>(plan.visits) - std::min(budget, each);
  plan.mesh_bytes = least;
  plan.filter_bytes = least + (budget > each ? spare / 2 : 0);
  return plan;
}

/// Writes the meshes of labels, and what the list has of them.
class LabelWriter {
 public:
  LabelWriter(const ExtractArguments& arguments, const StoreReader& store, fs::path folder)
      : arguments_(arguments),
        format_(format_of(arguments)),
        store_(store),
        folder_(std::move(folder)),
        list_((folder_ / kListName).string(), false) {
    list_.writer().append(
        fmt::format("{{\"schema\": {}, \"input\": {}, \"level\": {}, \"labels\": [", kJsonSchema,
                    ordered_json(store.info().name).dump(), *arguments.level));
    filter_ = filter_options(arguments.filters);
    filter_.smooth = 0;  // all meshes are smoothed together, before
    plan_ = plan_visits(arguments, filter_);
    filter_.memory = plan_.filter_bytes;
    filter_.threads = 1;
    if (has_levels(format_))
      levels_ = open_level_folder(folder_, {.as_tiles = format_ == MeshFormat::tiles3d,
                                            .sharded = arguments.sharded,
                                            .has_labels = true});
  }

  int visits() const { return plan_.visits; }

  void write(const LabelMesh& mesh) {
    const std::string name = file_of(mesh.label());
    const std::unique_ptr<MeshSink> sink = open_sink(mesh.label(), name);
    ordered_json entry{{"label", mesh.label()}};
    if (const LabelProperties* properties = find_properties(mesh.label()))
      add_properties(entry, *properties);
    entry["file"] = name.empty() ? ordered_json() : ordered_json(name);
    MeshSize size = mesh.size();
    if (filter_.any()) {
      MeshFilterOptions options = filter_;
      options.scratch_beside = folder_ / kListName;
      MeshFilter filter(*sink, options);
      mesh.write(filter);
      size = filter.size();
      if (const auto measure = filter.measure()) entry["measure"] = measure_json(*measure);
    } else {
      mesh.write(*sink);
    }
    entry["triangles"] = size.triangles;
    if (const auto* levels = dynamic_cast<const LevelSink*>(sink.get()))
      entry["levels"] = levels_json(levels->levels());
    entry["vertices"] = has_vertices(format_) ? ordered_json(size.vertices) : ordered_json();
    const std::lock_guard lock(mutex_);
    written_.vertices += size.vertices;
    written_.triangles += size.triangles;
    if (!levels_) bytes_ += sink->bytes();
    entries_.emplace(mesh.index(), entry.dump());
    write_entries();
  }

  /// Ends the list.
  void finish() {
    if (levels_) {
      levels_->finish();
      bytes_ += levels_->bytes();
    }
    FileWriter& out = list_.writer();
    out.append("\n]}\n");
    bytes_ += out.size();
    list_.publish();
  }

  MeshSize written() const { return written_; }
  std::uint64_t bytes() const { return bytes_; }

 private:
  std::string file_of(std::int64_t label) const {
    return levels_ ? levels_->file_of(label)
                   : fmt::format("{}{}", label, isobrick::extension_of(format_));
  }

  std::unique_ptr<MeshSink> open_sink(std::int64_t label, const std::string& name) {
    MeshProperties properties;
    if (const LabelProperties* known = find_properties(label))
      properties = {known->name, known->colour};
    if (!levels_)
      return create_mesh_file(folder_ / name, {.format = format_,
                                               .quantize = arguments_.quantize,
                                               .compress = arguments_.compress,
                                               .name = properties.name,
                                               .colour = properties.colour,
                                               .threads = 1,
                                               .memory = plan_.mesh_bytes});
    return levels_->add_mesh(label,
                             {.levels = arguments_.levels,
                              .makes_normals = arguments_.normals != std::optional(false),
                              .threads = 1},
                             properties);
  }

  /// Writes those that come next, in the order of the labels.
  void write_entries() {
    while (!entries_.empty() && entries_.begin()->first == entries_written_) {
      list_.writer().append(entries_written_++ > 0 ? ",\n" : "\n");
      list_.writer().append(entries_.begin()->second);
      entries_.erase(entries_.begin());
    }
  }

  /// What the image says of a label; null: nothing.
  const LabelProperties* find_properties(std::int64_t label) const {
    if (!store_.info().labels) return nullptr;
    const LabelTable& table = *store_.info().labels;
    const auto at = std::lower_bound(
        table.begin(), table.end(), label,
        [](const LabelProperties& p, std::int64_t value) { return p.label < value; });
    return at != table.end() && at->label == label ? &*at : nullptr;
  }

  const ExtractArguments& arguments_;
  MeshFormat format_;
  const StoreReader& store_;
  fs::path folder_;
  MeshFilterOptions filter_;
  VisitPlan plan_;
  std::unique_ptr<LevelFolder> levels_;  ///< in place of a file each; null for other formats
  std::mutex mutex_;
  OutputFile list_;
  std::map<std::uint64_t, std::string> entries_;  ///< that wait for those before them
  std::uint64_t entries_written_ = 0;
  MeshSize written_;
  std::uint64_t bytes_ = 0;
};

ordered_json report_json(const ExtractArguments& arguments, const std::string& output,
                         const LabelReport& report, const LabelWriter& writer) {
  return {{"command", "extract"},
          {"input", arguments.input.path},
          {"level", *arguments.level},
          {"output", output},
          {"output_bytes", writer.bytes()},
          {"labels", report.labels},
          {"triangles", writer.written().triangles},
          {"vertices", writer.written().vertices},
          {"bricks", {{"total", report.bricks}, {"read", report.bricks_read}}},
          {"brick_reads", report.brick_reads},
          {"bytes_read", report.bytes_read},
          {"scratch_bytes", report.scratch_bytes},
          {"seconds", {{"total", report.seconds}, {"write", report.write_seconds}}},
          {"peak_resident_bytes", peak_resident_bytes()}};
}

}  // namespace

std::vector<LabelRange> parse_labels(const std::string& text) {
  if (text == "all") return {};
  std::vector<LabelRange> ranges;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string_view part = std::string_view(text).substr(begin, end - begin);
    const std::size_t colon = part.find(':');
    const std::int64_t first = parse_label(part.substr(0, colon));
    ranges.push_back({first, colon == part.npos ? first : parse_label(part.substr(colon + 1))});
    if (ranges.back().last < first)
      throw UsageError(fmt::format("the range of labels '{}' ends before it begins", part));
    begin = end + 1;
  }
  return ranges;
}

int run_extract_labels(const ExtractArguments& given, Console& console) {
  ExtractArguments arguments = given;
  check_label_arguments(arguments);
  const std::string output = folder_name(arguments);
  check_replaces_no_input(output, std::array<fs::path, 1>{arguments.input.path});
  const OpenedVolume input = open_input(arguments.input, arguments.memory, arguments.threads,
                                        console, true, Downsampling::mode);
  const StoreReader& store = input.store();
  choose_mesh_unit(arguments, store, console);
  LabelOptions options{.labels = *arguments.labels,
                       .level = *arguments.level,
                       .smooth = arguments.filters.smooth,
                       .pass_band = arguments.filters.pass_band.value_or(0.1),
                       .memory = arguments.memory,
                       .threads = arguments.threads};
  options.roi = store_region(store, options.level, arguments.region);
  FolderOutput folder(output, arguments.force, is_own_name);
  LabelWriter writer(arguments, store, folder.folder());
  options.visits = writer.visits();
  options.scratch_beside = folder.folder();
  const LabelReport report = extract_labels(
      store, options, [&](const LabelMesh& mesh) { writer.write(mesh); }, console.progress());
  writer.finish();
  folder.publish();
  if (report.labels == 0)
    console.note("there is no label but the background 0, so the folder has no mesh");
  console.result(report_json(arguments, output, report, writer),
                 fmt::format("{} labels: {} triangles from {} of {} bricks in {}\n  {} ({})\n",
                             human_count(report.labels), human_count(writer.written().triangles),
                             human_count(report.bricks_read), human_count(report.bricks),
                             human_seconds(report.seconds), output, human_bytes(writer.bytes())));
  return 0;
}

}  // namespace isobrick::tools

#include "tools/extract_labels.h"

#include <array>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "io/bytes/output_guard.h"
#include "tools/extract_part.h"
#include "tools/format.h"
#include "tools/job.h"
#include "tools/output_name.h"
#include "tools/store_region.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

Label parse_label(std::string_view text) {
  if (const auto label = Label::parse(text)) return *label;
  throw UsageError(fmt::format(
      "'{}' is no label; --labels takes all, or whole numbers of 64 bits and ranges such as "
      "3,7,10:20",
      text));
}

LabelOutput output_of(const ExtractArguments& arguments) {
  LabelOutput output{.folder = arguments.output,
                     .format = arguments.format,
                     .quantize = arguments.quantize,
                     .compress = arguments.compress,
                     .levels = arguments.levels,
                     .sharded = arguments.sharded,
                     .normals = arguments.normals != std::optional(false),
                     .filters = arguments.filters,
                     .memory = arguments.memory,
                     .threads = arguments.threads,
                     .force = arguments.force,
                     .no_space_check = arguments.no_space_check};
  check_label_output(output);
  if (output.folder.empty())
    output.folder = stem_of_input(arguments.input.path, arguments.input.volume) + "_labels";
  else
    check_label_folder(output);
  return output;
}

ordered_json report_json(const ExtractArguments& arguments, const LabelOutput& output,
                         const WrittenLabels& written) {
  const LabelReport& report = written.report;
  return {{"command", "extract"},
          {"input", arguments.input.path},
          {"level", *arguments.level},
          {"output", output.folder},
          {"output_bytes", written.bytes},
          {"labels", report.labels},
          {"triangles", written.size.triangles},
          {"vertices", written.size.vertices},
          {"bricks", {{"total", report.bricks}, {"read", report.bricks_read}}},
          {"brick_reads", report.brick_reads},
          {"bytes_read", report.bytes_read},
          {"index_bytes", report.index_bytes},
          {"scratch_bytes", report.scratch_bytes},
          {"seconds", {{"total", report.seconds}, {"write", report.write_seconds}}}};
}

std::string report_text(const LabelOutput& output, const WrittenLabels& written) {
  return fmt::format("{} from {} of {} bricks in {}\n  {} ({})\n", sizes_text(written),
                     human_count(written.report.bricks_read), human_count(written.report.bricks),
                     human_seconds(written.report.seconds), output.folder,
                     human_bytes(written.bytes));
}

}  // namespace

std::vector<LabelRange> parse_labels(const std::string& text) {
  if (text == "all") return {};
  std::vector<LabelRange> ranges;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string_view part = std::string_view(text).substr(begin, end - begin);
    const std::size_t colon = part.find(':');
    const Label first = parse_label(part.substr(0, colon));
    ranges.push_back({first, colon == part.npos ? first : parse_label(part.substr(colon + 1))});
    if (ranges.back().last < first)
      throw UsageError(fmt::format("the range of labels '{}' ends before it begins", part));
    begin = end + 1;
  }
  return ranges;
}

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
      {arguments.search.kind.has_value(), "--search with a kind"},
      {arguments.max_triangles || !arguments.level, "--max-triangles"},
      {arguments.backend == Backend::cuda, "--backend cuda"}};
  for (const auto& [is_given, name] : of_isosurfaces)
    if (is_given)
      throw UsageError(
          fmt::format("{} is for isosurfaces, and --labels makes other meshes: leave out one of "
                      "them",
                      name));
}

LabelOptions label_options(const ExtractArguments& arguments, const StoreReader& store) {
  LabelOptions options{.labels = *arguments.labels,
                       .level = *arguments.level,
                       .smooth = arguments.filters.smooth,
                       .pass_band = arguments.filters.pass_band.value_or(0.1),
                       .memory = arguments.memory,
                       .threads = arguments.threads,
                       .use_lists = arguments.search.automatic};
  options.roi = store_region(store, options.level, arguments.region);
  return options;
}

int run_extract_labels(const ExtractArguments& given, Console& console) {
  ExtractArguments arguments = given;
  Ranks* const job = join_job(arguments.mpi, console);
  check_label_arguments(arguments);
  if (job != nullptr) share_machine(*job, arguments.memory, arguments.threads);
  LabelOutput output = output_of(arguments);
  check_replaces_no_input(output.folder, std::array<fs::path, 1>{arguments.input.path});
  const OpenedVolume input = open_shared_input(arguments, job, console, Downsampling::mode);
  const StoreReader& store = input.store();
  choose_mesh_unit(arguments, store, console);
  output.filters = arguments.filters;
  LabelOptions options = label_options(arguments, store);
  const LabelListing listing{store.info().name, options.level, store.info().labels};
  LabelsByPieces made;
  const bool is_by_pieces = arguments.resume || job != nullptr;
  if (is_by_pieces)
    made = make_labels_by_pieces(output, listing, store, options, job, console);
  else
    made.written = write_labels(output, listing, [&](const LabelTarget& target) {
      options.visits = target.visits;
      options.scratch_beside = target.scratch_beside;
      options.check_totals = target.check_totals;
      return extract_labels(store, options, target.visit, console.progress());
    });
  if (made.written.report.labels == 0)
    console.note("there is no label but the background 0, so the folder has no mesh");
  ordered_json result = report_json(arguments, output, made.written);
  if (is_by_pieces) result["pieces"] = {{"total", made.total}, {"kept", made.kept}};
  add_peak(job, result);
  std::string text = report_text(output, made.written);
  if (made.kept > 0) text += fmt::format("  went on with {} of {} pieces\n", made.kept, made.total);
  console.result(result, text);
  return 0;
}

}  // namespace isobrick::tools

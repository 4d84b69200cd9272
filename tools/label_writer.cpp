#include "tools/label_writer.h"

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <span>

#include <fmt/format.h>
#include <tbb/info.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include <isobrick/label_pieces.h>
#include "bricks/zarr/label_json.h"
#include "io/bytes/folder_output.h"
#include "io/bytes/folder_walk.h"
#include "io/bytes/output_file.h"
#include "io/meshes/levels/level_folder.h"
#include "pipeline/program_memory.h"
#include "tools/console.h"
#include "tools/extract_report.h"
#include "tools/format.h"
#include "tools/label_report.h"
#include "tools/measure_report.h"
#include "tools/mesh_space.h"
#include "tools/output_name.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// The list of the meshes, in their folder.
constexpr std::string_view kListName = "labels.json";

/// Whether a file may be part of an output: a mesh of a label, or the list.
bool is_own_name(std::string_view name) {
  if (name == kListName || is_level_file(name)) return true;
  const std::size_t dot = name.find('.');
  if (dot == name.npos || !find_mesh_format(name.substr(dot))) return false;
  std::string_view label = name.substr(0, dot);
  if (label.starts_with('-')) label.remove_prefix(1);
  return !label.empty() && label.find_first_not_of("0123456789") == label.npos;
}

/// How the budget is divided while meshes are written.
struct VisitPlan {
  int visits = 1;                ///< at the same time
  std::uint64_t mesh_bytes = 0;  ///< of each, for its file
  std::uint64_t filter_bytes = 0;
};

VisitPlan plan_visits(const LabelOutput& output, const MeshFilterOptions& filter) {
  constexpr std::uint64_t buffers = 3 * kMiB, least = 8 * kMiB, simplification = 120 * kMiB;
  const int threads = output.threads > 0 ? output.threads : tbb::info::default_concurrency();
  std::uint64_t each = buffers + least;
  if (filter.any()) each += least;
  if (filter.simplifies()) each += simplification;
  if (has_levels(output.mesh_format()) || output.compress)
    each += memory_of_file({.format = output.mesh_format(), .compress = output.compress}, 1, least);
  // A quarter of the budget is that of the labels.
  const std::uint64_t budget =
      output.memory - output.memory / 4 - std::min(output.memory / 4, kProgramBytes);
  if ((has_levels(output.mesh_format()) || output.compress) && budget < each)
    throw UsageError(
        fmt::format("a memory budget of {:.1f} MiB is too small for {}: at least --memory {}M is "
                    "needed",
                    in_mib(output.memory), output.compress ? "--compress" : "levels of detail",
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

MeshFilterOptions filter_of_meshes(const LabelOutput& output) {
  MeshFilterOptions filter = filter_options(output.filters);
  filter.smooth = 0;  // all meshes are smoothed together, before
  return filter;
}

/// Refuses meshes that do not fit the disk beside other files of `others` bytes.
void check_space(const LabelOutput& output, const LabelTotals& totals, int visits,
                 std::uint64_t others) {
  if (output.no_space_check) return;
  const fs::path folder = without_slash(output.folder);
  const MeshForm form{.format = output.mesh_format(),
                      .normals = output.normals && has_levels(output.mesh_format()),
                      .quantize = output.quantize,
                      .compress = output.compress,
                      .sharded = output.sharded};
  const std::uint64_t needed =
      others + predict_label_bytes(form, filter_of_meshes(output), totals, visits);
  const std::uint64_t free = free_space(folder);
  if (needed > free)
    throw Error(fmt::format(
        "'{}' will have {} triangles and need {}, but its disk has {} free; choose another disk "
        "(or --no-space-check)",
        folder.string(), human_count(totals.size.triangles), human_bytes(needed),
        human_bytes(free)));
}

/// Writes the meshes of labels, and what the list has of them.
class LabelWriter {
 public:
  LabelWriter(const LabelOutput& output, const LabelListing& listing, fs::path folder)
      : output_(output),
        format_(output.mesh_format()),
        listing_(listing),
        folder_(std::move(folder)),
        list_((folder_ / kListName).string(), false) {
    list_.writer().append(
        fmt::format("{{\"schema\": {}, \"input\": {}, \"level\": {}, \"labels\": [", kJsonSchema,
                    ordered_json(listing.name).dump(), listing.level));
    filter_ = filter_of_meshes(output);
    plan_ = plan_visits(output, filter_);
    filter_.memory = plan_.filter_bytes;
    filter_.threads = 1;
    if (has_levels(format_))
      levels_ = open_level_folder(folder_, {.as_tiles = format_ == MeshFormat::tiles3d,
                                            .compress = output.compress,
                                            .sharded = output.sharded,
                                            .has_labels = true});
  }

  int visits() const { return plan_.visits; }

  void check_totals(const LabelTotals& totals) const {
    check_space(output_, totals, plan_.visits, 0);
  }

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
      entry["levels"] = tools::levels_json(levels->levels());
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
  std::string file_of(const Label& label) const {
    return levels_ ? levels_->file_of(label) : label.text().append(isobrick::extension_of(format_));
  }

  std::unique_ptr<MeshSink> open_sink(const Label& label, const std::string& name) {
    MeshProperties properties;
    if (const LabelProperties* known = find_properties(label))
      properties = {known->name, known->colour};
    if (!levels_)
      return create_mesh_file(folder_ / name, {.format = format_,
                                               .quantize = output_.quantize,
                                               .compress = output_.compress,
                                               .name = properties.name,
                                               .colour = properties.colour,
                                               .threads = 1,
                                               .memory = plan_.mesh_bytes});
    return levels_->add_mesh(
        label, {.levels = output_.levels, .makes_normals = output_.normals, .threads = 1},
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
  const LabelProperties* find_properties(const Label& label) const {
    if (!listing_.labels) return nullptr;
    const LabelTable& table = *listing_.labels;
    const auto at = std::lower_bound(
        table.begin(), table.end(), label,
        [](const LabelProperties& p, const Label& value) { return p.label < value; });
    return at != table.end() && at->label == label ? &*at : nullptr;
  }

  const LabelOutput& output_;
  MeshFormat format_;
  const LabelListing& listing_;
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

}  // namespace

MeshFormat LabelOutput::mesh_format() const {
  if (format) return *format;
  const auto of_name = find_mesh_format(without_slash(folder).extension().string());
  return of_name && has_levels(*of_name) ? *of_name : MeshFormat::ply;
}

void check_label_output(const LabelOutput& output) {
  check_filters(output.filters, false);
  if (is_standard_output(output.folder))
    throw UsageError("standard output takes one mesh, and each label has one: name a folder");
  refuse_url_output(output.folder);
  if (output.format == MeshFormat::pvtp)
    throw UsageError("PVTP has several files for a mesh; choose another --format for labels");
  if (output.quantize && output.format != MeshFormat::glb)
    throw UsageError("--quantize is for GLB only: add --format glb");
  const MeshForm form{.format = output.mesh_format(),
                      .compress = output.compress,
                      .levels = output.levels,
                      .sharded = output.sharded};
  check_compression(form);
  check_levels(form);
}

void check_label_folder(const LabelOutput& output) {
  const MeshFormat format = output.mesh_format();
  const std::string_view own = isobrick::extension_of(format);
  refuse_misleading_name(output.folder,
                         std::span(&own, has_levels(format) ? std::size_t{1} : std::size_t{0}),
                         "labels become a folder with a mesh for each label");
}

WrittenLabels write_labels(const LabelOutput& output, const LabelListing& listing,
                           const MakeLabels& make) {
  FolderOutput folder(output.folder, output.force, is_own_name);
  LabelWriter writer(output, listing, folder.folder());
  const LabelReport report =
      make({.visits = writer.visits(),
            .scratch_beside = folder.path(),
            .check_totals = [&](const LabelTotals& totals) { writer.check_totals(totals); },
            .visit = [&](const LabelMesh& mesh) { writer.write(mesh); }});
  writer.finish();
  folder.publish();
  return {report, writer.written(), writer.bytes()};
}

LabelReport merge_labels(const LabelOutput& output, std::span<const fs::path> pieces,
                         const LabelTarget& target, Progress& progress) {
  // The scratch file is as large as the pieces; how large single meshes are is not known yet.
  const LabelPiecesInfo info = read_label_pieces(pieces);
  check_space(output, {.labels = 1, .size = info.size}, 0, info.bytes);
  return merge_label_pieces(pieces,
                            {.memory = output.memory,
                             .threads = output.threads,
                             .visits = target.visits,
                             .scratch_beside = target.scratch_beside,
                             .check_totals = target.check_totals},
                            target.visit, progress);
}

std::string sizes_text(const WrittenLabels& written) {
  return fmt::format("{} labels: {} triangles", human_count(written.report.labels),
                     human_count(written.size.triangles));
}

}  // namespace isobrick::tools

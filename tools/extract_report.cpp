#include "tools/extract_report.h"

#include <fmt/format.h>

#include "tools/format.h"
#include "tools/measure_report.h"
#include "tools/mesh_space.h"

namespace isobrick::tools {
namespace {

using nlohmann::ordered_json;

/// Whether the mesh that was written shares vertices. Those of an STL or of a picture are of no
/// file: how many there are depends on the tiles.
bool is_welded(const ExtractedSurface& surface) {
  return !surface.output.empty() && has_vertices(surface.form.format);
}

ordered_json number_if(bool known, std::uint64_t number) {
  return known ? ordered_json(number) : ordered_json();
}

/// The backend that made the surface, and how long its stages were busy.
void add_backend(ordered_json& object, const ExtractReport& r) {
  object["backend"] = r.backend;
  object["device"] = r.device.empty() ? ordered_json() : ordered_json(r.device);
  object["gpu_refusal"] = r.gpu_refusal.empty() ? ordered_json() : ordered_json(r.gpu_refusal);
  // Made first: an object that operator[] makes of null is not whole where memory ends.
  object["stages"] = ordered_json::object();
  for (const auto& [name, stage] : stages_of(r))
    object["stages"][std::string(name)] = {{"seconds", stage.seconds}, {"bytes", stage.bytes}};
  object["bound"] = bound_of(r);
  if (r.backend != "cuda") return;
  object["resident"] = r.resident;
  object["launches"] = r.launches;
  object["device_bytes"] = r.device_bytes;
  object["device_bytes_in_use"] = r.device_bytes_in_use;
  object["pinned_bytes"] = r.pinned_bytes;
  object["pool_bricks"] = r.pool_bricks;
}

std::string what_was_read(const ExtractReport& r) {
  return fmt::format("from {} of {} bricks in {}", human_count(r.bricks_read),
                     human_count(r.bricks), human_seconds(r.seconds));
}

}  // namespace

std::string goal_note(std::uint64_t triangles, const FilteredSurface& filtered,
                      const MeshFilterOptions& filter) {
  constexpr double kTolerance = 1.05;
  if (!filtered.simplify_goal ||
      static_cast<double>(triangles) <= kTolerance * static_cast<double>(*filtered.simplify_goal))
    return {};
  return fmt::format("{} triangles are left instead of {}: components, handles and borders stay{}",
                     triangles, *filtered.simplify_goal,
                     filter.max_error > 0 ? ", and what --max-error does not permit" : "");
}

ordered_json estimate_json(const ExtractedSurface& surface, const ExtractEstimate& e) {
  return {{"isovalue", surface.options.isovalue},
          {"bricks", {{"total", e.active.bricks}, {"active", e.active.active_bricks}}},
          {"active_blocks", e.active.active_blocks},
          {"triangles", e.mesh.triangles},
          {"vertices", number_if(has_vertices(surface.form.format), e.mesh.vertices)},
          {"uncertainty", e.uncertainty},
          {"file_bytes", predict_bytes(surface.form, e.mesh).file},
          {"memory_bytes", e.memory}};
}

std::string estimate_text(const ExtractedSurface& surface, const ExtractEstimate& e) {
  return fmt::format(
      "isovalue {}: about {} triangles{} (± {:.0f} %), {} as {}; {} of {} bricks "
      "active, {} of memory\n",
      surface.options.isovalue, human_count(e.mesh.triangles),
      has_vertices(surface.form.format)
          ? fmt::format(" and {} vertices", human_count(e.mesh.vertices))
          : "",
      100 * e.uncertainty, human_bytes(predict_bytes(surface.form, e.mesh).file),
      name_of(surface.form.format), human_count(e.active.active_bricks),
      human_count(e.active.bricks), human_bytes(e.memory));
}

ordered_json levels_json(const std::vector<WrittenLevel>& levels) {
  ordered_json list = ordered_json::array();
  for (const WrittenLevel& level : levels)
    list.push_back(
        {{"triangles", level.triangles}, {"fragments", level.fragments}, {"bytes", level.bytes}});
  return list;
}

ordered_json report_json(const ExtractedSurface& surface, const ExtractReport& r,
                         const FilteredSurface& filtered, std::uint64_t bytes) {
  ordered_json object{
      {"isovalue", surface.options.isovalue},
      {"output", nullptr},
      {"preview", nullptr},
      {"output_bytes", bytes},
      {"triangles", r.triangles},
      {"vertices", number_if(is_welded(surface), r.vertices)},
      {"bricks", {{"total", r.bricks}, {"active", r.active_bricks}, {"read", r.bricks_read}}},
      {"brick_reads", r.brick_reads},
      {"bytes_read", r.bytes_read},
      {"seconds",
       {{"total", r.seconds},
        {"plan", r.plan_seconds},
        {"decode", r.decode_seconds},
        {"surface", r.surface_seconds},
        {"sink", r.sink.seconds}}},
      {"index",
       {{"used", r.index ? name_of(*r.index) : "linear"},
        {"bytes_read", r.search_bytes},
        {"seconds", r.search_seconds}}}};
  add_backend(object, r);
  if (surface.options.drop_degenerate) object["degenerate_triangles"] = r.degenerate_triangles;
  if (surface.filter.changes_mesh())
    object["extracted"] = {{"triangles", filtered.extracted.triangles},
                           {"vertices", filtered.extracted.vertices}};
  if (filtered.simplify_goal) object["simplify_goal"] = *filtered.simplify_goal;
  if (filtered.measure) object["measure"] = measure_json(*filtered.measure);
  if (!filtered.levels.empty()) object["levels"] = levels_json(filtered.levels);
  if (!surface.attributes.empty()) object["attributes"] = surface.attributes;
  if (!surface.output.empty()) object["output"] = surface.output.string();
  if (!surface.preview.empty()) object["preview"] = surface.preview.string();
  return object;
}

std::string report_text(const ExtractedSurface& surface, const ExtractReport& r,
                        const FilteredSurface& filtered, std::uint64_t bytes, bool only) {
  std::string text = fmt::format(
      "isovalue {}: {} triangles{}{}\n", surface.options.isovalue, human_count(r.triangles),
      is_welded(surface) ? fmt::format(", {} vertices", human_count(r.vertices)) : "",
      only ? fmt::format(" {}", what_was_read(r)) : "");
  if (!r.gpu_refusal.empty())
    text += fmt::format("  on the CPU, for the GPU cannot: {}\n", r.gpu_refusal);
  if (r.backend == "cuda")
    text += fmt::format("  on {} with {} of its memory, bound by {}\n", r.device,
                        human_bytes(r.device_bytes), bound_of(r));
  if (surface.options.drop_degenerate)
    text +=
        fmt::format("  {} degenerate triangles left out\n", human_count(r.degenerate_triangles));
  if (filtered.extracted.triangles > r.triangles)
    text += fmt::format("  of {} triangles\n", human_count(filtered.extracted.triangles));
  if (filtered.measure) text += measure_text(*filtered.measure);
  if (filtered.levels.size() > 1)
    text += fmt::format("  {} levels of detail, the coarsest of {} triangles\n",
                        filtered.levels.size(), human_count(filtered.levels.back().triangles));
  if (!surface.output.empty())
    text += fmt::format("  {} ({})\n", surface.output.string(), human_bytes(bytes));
  if (!surface.preview.empty()) text += fmt::format("  {}\n", surface.preview.string());
  return text;
}

std::vector<PassReport> passes_of(std::span<const ExtractReport> reports,
                                  std::span<const std::string> names) {
  std::vector<PassReport> passes;
  for (std::size_t i = 0; i < reports.size(); ++i) {
    if (reports[i].pass == passes.size()) passes.push_back({{}, reports[i]});
    passes[reports[i].pass].outputs.push_back(names[i]);
  }
  return passes;
}

ordered_json passes_json(std::span<const PassReport> passes) {
  ordered_json list = ordered_json::array();
  for (const PassReport& pass : passes)
    list.push_back({{"outputs", pass.outputs},
                    {"bricks_read", pass.report.bricks_read},
                    {"brick_reads", pass.report.brick_reads},
                    {"bytes_read", pass.report.bytes_read},
                    {"seconds", pass.report.seconds}});
  return list;
}

std::string passes_text(std::span<const PassReport> passes) {
  std::string text;
  for (const PassReport& pass : passes)
    text += fmt::format("{} {} {}\n", human_count(pass.outputs.size()),
                        pass.outputs.size() == 1 ? "file" : "files", what_was_read(pass.report));
  if (passes.size() > 1)
    text += fmt::format(
        "{} passes over the store, because the memory budget has no room for all at once\n",
        human_count(passes.size()));
  return text;
}

}  // namespace isobrick::tools

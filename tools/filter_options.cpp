#include "tools/filter_options.h"

#include <cmath>
#include <string>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "tools/parse.h"

namespace isobrick::tools {
namespace {

/// "0.1" and "10%" are ratios, "1000", "500k" and "1.5M" are triangles.
void parse_simplify(const std::string& text, FilterArguments& filters) {
  const bool is_percent = text.ends_with('%');
  const bool has_unit = text.find_last_of("kKMG") != text.npos;
  if (has_unit || (!is_percent && text.find('.') == text.npos && text != "1" && text != "0")) {
    filters.simplify_triangles = parse_count(text);
    return;
  }
  const double value = parse_number(is_percent ? text.substr(0, text.size() - 1) : text);
  filters.simplify_ratio = is_percent ? value / 100 : value;
  if (!(filters.simplify_ratio > 0 && filters.simplify_ratio <= 1))
    throw UsageError(fmt::format(
        "'{}' is no part of a mesh: a ratio is above 0 and at most 1, such as 0.1 or 10%", text));
}

double parse_length(const std::string& text) {
  const double length = parse_number(text);
  if (!(length > 0 && std::isfinite(length)))
    throw UsageError(fmt::format("'{}' is no error: a length above 0", text));
  return length;
}

std::string parse_unit(const std::string& text) {
  std::string name = unit_name(text);
  if (name.empty()) throw UsageError(no_unit_text(text));
  return name;
}

}  // namespace

void add_filters(CLI::App* app, FilterArguments& filters) {
  add_parsed(app, filters.min_component, parse_count,
             {"--min-component", "N",
              "Drop the components of the mesh that have fewer than N triangles, such as 500"});
  add_parsed(app, filters.largest, parse_count,
             {"--largest", "N", "Keep the N components with most triangles"});
  add_parsed(app, filters.smooth, [](const std::string& text) { return parse_int(text, 1, 10000); },
             {"--smooth", "N",
              "Smooth the mesh by N iterations that keep its size (Taubin), such as 20; borders "
              "stay where they are"});
  add_parsed(
      app, filters.pass_band,
      [](const std::string& text) { return std::optional(parse_number(text)); },
      {"--pass-band", "K",
       "Of --smooth: what varies more along the surface goes, from 0, all, to 0.8, little", "0.1"});
  add_text(app,
           {"--simplify", "RATIO|N",
            "Simplify the mesh to a part of its triangles, such as 0.1 or 10%, or to N, such as "
            "500k: where it is flat first, within --max-error"},
           [&filters](const std::string& text) { parse_simplify(text, filters); });
  add_parsed(app, filters.max_error, [](const std::string& text) { return parse_length(text); },
             {"--max-error", "LENGTH",
              "Of a simplified mesh: how far it may be from the original, in the unit of world "
              "space; without --simplify as few triangles as this permits"});
  add_parsed(
      app, filters.unit, parse_unit,
      {"--mesh-unit", "NAME", "Unit of the mesh, such as mm or micrometer", "that of the volume"});
  add_flag(app, "--measure", filters.measure,
           "Report area, enclosed volume, bounds, components and Euler number of the mesh");
}

void set_for_print(FilterArguments& filters) {
  constexpr int kIterations = 10;
  constexpr std::uint64_t kTriangles = 500'000;
  if (filters.min_component == 0 && filters.largest == 0) filters.largest = 1;
  if (filters.smooth == 0) filters.smooth = kIterations;
  if (!filter_options(filters).simplifies()) filters.simplify_triangles = kTriangles;
}

void check_filters(const FilterArguments& filters, bool estimates) {
  if (filters.min_component > 0 && filters.largest > 0)
    throw UsageError("--min-component and --largest both choose components: give one of them");
  if (filters.pass_band && filters.smooth == 0)
    throw UsageError("--pass-band is for --smooth: add --smooth N");
  if (filters.measure && estimates)
    throw UsageError("--measure needs the mesh, which --estimate does not make: leave out one");
  isobrick::check_filters(filter_options(filters));
}

MeshFilterOptions filter_options(const FilterArguments& filters) {
  MeshFilterOptions options{.min_component = filters.min_component,
                            .largest = filters.largest,
                            .smooth = filters.smooth,
                            .simplify_ratio = filters.simplify_ratio,
                            .simplify_triangles = filters.simplify_triangles,
                            .max_error = filters.max_error,
                            .unit = filters.unit,
                            .measure = filters.measure};
  if (filters.pass_band) options.pass_band = *filters.pass_band;
  return options;
}

}  // namespace isobrick::tools

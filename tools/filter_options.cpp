#include "tools/filter_options.h"

namespace isobrick::tools {

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
  add_flag(app, "--measure", filters.measure,
           "Report area, enclosed volume, bounds, components and Euler number of the mesh");
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
                            .measure = filters.measure};
  if (filters.pass_band) options.pass_band = *filters.pass_band;
  return options;
}

}  // namespace isobrick::tools

#include "tools/label_report.h"

#include <algorithm>

#include <fmt/format.h>

#include "bricks/zarr/label_json.h"
#include "tools/format.h"

namespace isobrick::tools {

using nlohmann::ordered_json;

void add_properties(ordered_json& entry, const LabelProperties& properties) {
  if (!properties.name.empty()) entry["name"] = properties.name;
  if (properties.colour) entry["colour"] = *properties.colour;
}

ordered_json labels_json(const std::optional<LabelTable>& labels) {
  if (!labels) return nullptr;
  ordered_json list = ordered_json::array();
  for (const LabelProperties& properties : *labels) {
    ordered_json entry{{"label", properties.label}};
    add_properties(entry, properties);
    list.push_back(std::move(entry));
  }
  return list;
}

std::string labels_text(const std::optional<LabelTable>& labels) {
  if (!labels) return {};
  const auto named = static_cast<std::uint64_t>(std::count_if(
      labels->begin(), labels->end(), [](const LabelProperties& p) { return !p.name.empty(); }));
  const auto coloured = static_cast<std::uint64_t>(
      std::count_if(labels->begin(), labels->end(),
                    [](const LabelProperties& p) { return p.colour.has_value(); }));
  return fmt::format("label image  {} names, {} colours\n", human_count(named),
                     human_count(coloured));
}

}  // namespace isobrick::tools

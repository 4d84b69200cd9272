#pragma once

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include <isobrick/label_properties.h>

namespace isobrick::tools {

/// Adds the name and the colour of a label where they are known.
void add_properties(nlohmann::ordered_json& entry, const LabelProperties& properties);

/// What `info` reports of a label image; null of any other.
nlohmann::ordered_json labels_json(const std::optional<LabelTable>& labels);
/// A line, or nothing.
std::string labels_text(const std::optional<LabelTable>& labels);

}  // namespace isobrick::tools

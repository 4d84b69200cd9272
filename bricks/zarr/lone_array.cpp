#include "bricks/zarr/lone_array.h"

#include <fmt/format.h>

#include <string_view>
#include <vector>

#include <isobrick/error.h>
#include "bricks/zarr/json_reader.h"

namespace isobrick::inline v0 {
namespace {

using Json = nlohmann::ordered_json;

/// Names of an array's axes before its last three: its own where it has
/// them. Without them, five dimensions are t, c, z, y, x, and other axes have no name ("?").
std::vector<std::string> leading_names(const ArrayMetadata& array) {
  const std::size_t count = array.shape.size() - 3;
  std::vector<std::string> names(count, "?");
  if (count == 2) names = {"t", "c"};
  for (std::size_t i = 0; i < count && array.dimension_names.size() == array.shape.size(); ++i)
    if (const std::string& name = array.dimension_names[i]; !name.empty()) names[i] = name;
  return names;
}

}  // namespace

std::string group_of(const ArrayMetadata& array, const std::string& where) {
  if (array.shape.size() < 3)
    throw Error(
        fmt::format("{}: arrays of {} dimensions are no volumes", where, array.shape.size()));
  Json axes = Json::array();
  for (const std::string& name : leading_names(array)) axes.push_back({{"name", name}});
  for (const char* name : {"z", "y", "x"}) axes.push_back({{"name", name}});
  const std::vector<int> ones(array.shape.size(), 1);
  Json dataset{{"path", "."}};
  dataset["coordinateTransformations"] = Json::array({Json{{"type", "scale"}, {"scale", ones}}});
  Json multiscale{{"axes", std::move(axes)}, {"datasets", Json::array({std::move(dataset)})}};
  Json group{{"zarr_format", 3}, {"node_type", "group"}};
  group["attributes"] = {
      {"ome", {{"version", "0.5"}, {"multiscales", Json::array({std::move(multiscale)})}}}};
  return group.dump();
}

std::string with_dimension_names(std::string_view array, std::string_view attributes,
                                 const std::string& where) {
  const nlohmann::json parsed = parse_json(attributes, where);
  if (!parsed.is_object() || !parsed.contains("_ARRAY_DIMENSIONS")) return std::string(array);
  nlohmann::json named = nlohmann::json::parse(array);
  named["dimension_names"] = parsed["_ARRAY_DIMENSIONS"];
  return named.dump();
}

void check_axis_order(const ArrayMetadata& array, const std::string& where) {
  constexpr std::string_view kLast = "zyx";
  const std::vector<std::string>& names = array.dimension_names;
  bool misplaced = false;
  std::string all;
  for (std::size_t i = 0; i < names.size(); ++i) {
    all += (all.empty() ? "" : ", ") + (names[i].empty() ? "(no name)" : names[i]);
    if (names[i].size() != 1) continue;
    const std::size_t last = kLast.find(static_cast<char>(names[i][0] | 0x20));
    misplaced |= last != kLast.npos && i + kLast.size() != names.size() + last;
  }
  if (misplaced)
    throw Error(
        fmt::format("{}: its dimensions are {}: only arrays whose last are z, y, x are read; write "
                    "it transposed",
                    where, all));
}

}  // namespace isobrick

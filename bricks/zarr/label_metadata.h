#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <isobrick/label_properties.h>
#include <isobrick/storage.h>
#include "bricks/zarr/json_reader.h"

namespace isobrick::inline v0 {

/// OME-Zarr's `image-label`: names are those of `properties`, as `name`, `label-name` or else
/// the first text, and colours those of `colors`. What it has of labels that are no whole numbers
/// is left out.
LabelTable parse_image_label(const JsonReader& image_label);

/// The same as JSON. Of more than kMaxDescribedLabels nothing is kept, because all of an image's
/// metadata lies in one file.
nlohmann::ordered_json image_label_json(const LabelTable& labels);
inline constexpr std::size_t kMaxDescribedLabels = 20'000;

/// Names of the label images that an image has in its group `labels`, none where there is no such
/// group. Throws as JsonReader does.
std::vector<std::string> label_image_names(const Storage& storage);

}  // namespace isobrick

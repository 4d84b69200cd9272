#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <isobrick/label_properties.h>
#include "pipeline/labels/label_image.h"
#include "pipeline/pieces/piece_format.h"

// The description of a piece of labels; docs/reference/piece_format.md describes it.

namespace isobrick::inline v0 {

/// What a piece of labels begins with.
struct LabelPieceDescription : PieceKey {
  std::string name;  ///< of the store

  int level() const;
  LabelImage image() const;
  std::optional<LabelTable> properties() const;
};

/// Everything that meshes of labels depend on, and what their list has of the store.
nlohmann::json label_mesh_json(const StoreReader& store, const LabelOptions& options,
                               const LabelImage& image);

/// The text of a description: one for each description.
std::string to_text(const LabelPieceDescription& description);
/// Nothing for a text that is none.
std::optional<LabelPieceDescription> parse_label_description(std::string_view text);

}  // namespace isobrick

#pragma once

#include <string>

#include <isobrick/labels.h>
#include <isobrick/transform.h>
#include "pipeline/labels/label_selection.h"
#include "surface/labels/label_points.h"

namespace isobrick::inline v0 {

/// What meshes of labels are made of, and how.
struct LabelImage {
  std::string name;  ///< for messages
  Int3 extent;       ///< samples
  ScalarType type = ScalarType::u8;
  Transform transform;
  Box3 roi;  ///< samples
  LabelSelection labels;
  LabelSmoothing smoothing;

  /// The tiles that have a cell of the region, or one at its border.
  Box3 tiles() const;
};

}  // namespace isobrick

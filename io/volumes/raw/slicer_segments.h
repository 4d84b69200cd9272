#pragma once

#include <functional>
#include <optional>
#include <string>

#include <isobrick/label_properties.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// The segments of a segmentation of 3D Slicer, from the key/value pairs of its NRRD header, such
/// as Segment0_LabelValue. `pair(key)` is a value, empty where there is none. Segments that overlap
/// are in several layers, which are channels; those of other layers than `layer` are left out, and
/// so is what has no label. Nothing of a header without segments.
std::optional<LabelTable> read_slicer_segments(
    const std::function<std::string(const std::string& key)>& pair, Index layer);

}  // namespace isobrick

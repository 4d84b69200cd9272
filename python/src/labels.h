#pragma once

#include <pybind11/pybind11.h>

#include <functional>

#include <isobrick/labels.h>

namespace isobrick::python {

/// Passes the meshes of labels to a visitor, and reports progress.
using ExtractLabels =
    std::function<void(const LabelOptions& options, const LabelVisitor& visit, Progress& progress)>;

/// The meshes of labels in memory: a dictionary from labels, in ascending order, to meshes.
pybind11::dict label_meshes(LabelOptions options, const pybind11::object& callback,
                            const ExtractLabels& extract);

}  // namespace isobrick::python

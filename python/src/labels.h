#pragma once

#include <pybind11/pybind11.h>

#include <functional>

#include <isobrick/labels.h>
#include "python/src/interruptible.h"

namespace isobrick::python {

/// Makes the meshes of labels and passes them to a visitor.
using MakeLabelMeshes = std::function<void(const LabelVisitor& visit, const Reporter& reporter)>;

/// The meshes of labels in memory: a dictionary from labels, in ascending order, to meshes.
pybind11::dict label_meshes(const pybind11::object& callback, const MakeLabelMeshes& make);

}  // namespace isobrick::python

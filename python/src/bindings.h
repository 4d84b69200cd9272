#pragma once

#include <pybind11/pybind11.h>

// Each adds what its file binds to the module isobrick._isobrick.
namespace isobrick::python {

void bind_errors();
void bind_options(pybind11::module_& module);
void bind_mesh(pybind11::module_& module);
void bind_device(pybind11::module_& module);
void bind_extractor(pybind11::module_& module);
void bind_store(pybind11::module_& module);
void bind_operations(pybind11::module_& module);
void bind_pieces(pybind11::module_& module);
void bind_skimage(pybind11::module_& module);

}  // namespace isobrick::python

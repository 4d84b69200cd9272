#include "python/src/bindings.h"

// The layer in C++ below the package. Arguments are checked and described by the package; here are
// only the checks without which memory would be read that is none.
PYBIND11_MODULE(_isobrick, module) {
  using namespace isobrick::python;
  module.doc() = "Bindings of Isobrick's C++ libraries; use the package isobrick.";
  module.attr("__version__") = ISOBRICK_PYTHON_VERSION;
  bind_errors();
  bind_options(module);
  bind_mesh(module);
  bind_device(module);
  bind_extractor(module);
  bind_store(module);
  bind_operations(module);
  bind_pieces(module);
  bind_skimage(module);
}

#include "python/src/isovalues.h"

#include <pybind11/numpy.h>

#include <cstdint>

namespace isobrick::python {

namespace py = pybind11;

py::dict describe(const Histogram& h) {
  return py::dict(py::arg("counts") = py::array_t<std::uint64_t>(
                      static_cast<py::ssize_t>(h.counts.size()), h.counts.data()),
                  py::arg("first") = h.first, py::arg("bin_width") = h.bin_width,
                  py::arg("lo") = h.lo, py::arg("hi") = h.hi, py::arg("level") = h.level,
                  py::arg("nan") = h.not_a_number, py::arg("infinite") = h.infinite);
}

}  // namespace isobrick::python

#include <exception>
#include <filesystem>

#include <isobrick/error.h>
#include "python/src/bindings.h"

namespace isobrick::python {
namespace {

namespace py = pybind11;

void raise(const char* name, const std::exception& error) {
  const py::object type = py::module_::import("isobrick._errors").attr(name);
  PyErr_SetString(type.ptr(), error.what());
}

}  // namespace

void bind_errors() {
  py::register_exception_translator([](std::exception_ptr failure) {
    try {
      if (failure) std::rethrow_exception(failure);
    } catch (const UsageError& error) {
      raise("UsageError", error);
    } catch (const DamageError& error) {
      raise("DamageError", error);
    } catch (const Error& error) {
      raise("Error", error);
    } catch (const std::filesystem::filesystem_error& error) {
      PyErr_SetString(PyExc_OSError, error.what());
    }
  });
}

}  // namespace isobrick::python

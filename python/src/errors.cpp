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

/// An exception of the class that Python has for a value of errno.
void raise_system(const SystemError& error) {
  const py::module_ errors = py::module_::import("isobrick._errors");
  const py::object raised = errors.attr("system_error")(error.code(), error.what());
  PyErr_SetObject(py::type::handle_of(raised).ptr(), raised.ptr());
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
    } catch (const SystemError& error) {
      raise_system(error);
    } catch (const Error& error) {
      raise("Error", error);
    } catch (const std::filesystem::filesystem_error& error) {
      PyErr_SetString(PyExc_OSError, error.what());
    }
  });
}

}  // namespace isobrick::python

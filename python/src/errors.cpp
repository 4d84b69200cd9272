#include <exception>
#include <filesystem>

#include <isobrick/error.h>
#include "python/src/bindings.h"

namespace isobrick::python {
namespace {

namespace py = pybind11;

/// Raises what a function of the package makes of its arguments.
template <class... Args>
void raise(const char* function, const Args&... args) {
  const py::object error = py::module_::import("isobrick._errors").attr(function)(args...);
  PyErr_SetObject(py::type::handle_of(error).ptr(), error.ptr());
}

}  // namespace

void bind_errors() {
  py::register_exception_translator([](std::exception_ptr failure) {
    try {
      if (failure) std::rethrow_exception(failure);
    } catch (const UsageError& error) {
      raise("error_of", "UsageError", error.what());
    } catch (const DamageError& error) {
      raise("error_of", "DamageError", error.what());
    } catch (const SystemError& error) {
      raise("system_error", error.code(), error.what());
    } catch (const Error& error) {
      raise("error_of", "Error", error.what());
    } catch (const std::filesystem::filesystem_error& error) {
      PyErr_SetString(PyExc_OSError, error.what());
    }
  });
}

}  // namespace isobrick::python

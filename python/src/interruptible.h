#pragma once

#include <pybind11/pybind11.h>

#include <functional>
#include <optional>
#include <stop_token>

#include <isobrick/progress.h>

namespace isobrick::python {

namespace py = pybind11;

/// What an operation reports to, and what ends it.
struct Reporter {
  Progress& progress;
  std::stop_token cancel;
};

/// Runs `work` on a thread of its own without the GIL. Meanwhile the calling thread, which holds
/// the GIL, handles signals and calls `callback(stage, done, total)` ten times a second, unless it
/// is None. What a handler or the callback raises ends the work and is raised here. So do
/// exceptions of the work.
void run_interruptibly(const py::object& callback, const std::function<void(Reporter)>& work);

/// The same for work with a result.
template <class F>
auto interruptible(const py::object& callback, F&& work) {
  std::optional<std::invoke_result_t<F, Reporter>> result;
  run_interruptibly(callback, [&](Reporter reporter) { result.emplace(work(reporter)); });
  return std::move(*result);
}

}  // namespace isobrick::python

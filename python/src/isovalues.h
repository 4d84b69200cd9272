#pragma once

#include <pybind11/pybind11.h>

#include <optional>
#include <string>
#include <utility>

#include <isobrick/histogram.h>
#include <isobrick/isovalue.h>

namespace isobrick::python {

/// The fields of a histogram by name.
pybind11::dict describe(const Histogram& histogram);

/// An isovalue and why it is suggested.
using Suggestion = std::optional<std::pair<double, std::string>>;

inline Suggestion pair_of(const std::optional<SuggestedIsovalue>& suggested) {
  if (!suggested) return std::nullopt;
  return std::pair(suggested->value, suggested->why);
}

}  // namespace isobrick::python

#pragma once

#include <pybind11/numpy.h>

#include <optional>

#include <isobrick/scalar.h>
#include <isobrick/volume.h>

namespace isobrick::python {

/// The type of an array's samples; nullopt for one that is none of the eight, or of another byte
/// order than this machine's.
std::optional<ScalarType> scalar_type(const pybind11::array& array);

/// The same of a kind ('u', 'i', 'f' or 'b') and bytes a sample, in native byte order.
std::optional<ScalarType> scalar_type(char kind, pybind11::ssize_t bytes);

/// The samples of an array [z, y, x] where they lie; the array must outlive the volume. Throws
/// UsageError for an array that is no volume.
Volume volume_of(const pybind11::array& array);
/// The same with samples taken for those of another type of their size.
Volume volume_of(const pybind11::array& array, ScalarType type);

/// Samples that a Python function reads: read(lo, hi), both (z, y, x), returns a new array [z, y,
/// x] of `type` in C order. It is called with the GIL, from one thread at a time. The volume keeps
/// the function alive. What it raises ends the operation.
Volume volume_of(const pybind11::object& read, Int3 extent, ScalarType type);

/// Sets which samples are missing: those of the value `nodata`, and those where `mask`, an array of
/// one byte a sample or None, is 0. The mask must outlive the volume.
void add_missing(Volume& volume, std::optional<double> nodata, const pybind11::object& mask);

}  // namespace isobrick::python

#pragma once

#include <pybind11/pybind11.h>

#include <isobrick/convert.h>
#include <isobrick/store_reader.h>
#include <isobrick/volume_source.h>

namespace isobrick::python {

/// Dictionaries of what is known of a store, a source, and of what a conversion did.
pybind11::dict describe(const StoreInfo& info);
pybind11::dict describe(const VolumeInfo& info);
pybind11::dict describe(const ConvertReport& report);

}  // namespace isobrick::python

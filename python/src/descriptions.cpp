#include "python/src/descriptions.h"

#include <cmath>
#include <string>

#include <isobrick/sample_value.h>
#include "python/src/casters.h"

namespace isobrick::python {
namespace {

namespace py = pybind11;

void add_transform(py::dict& to, const Transform& transform) {
  to["spacing"] = transform.spacing;
  to["origin"] = transform.origin;
  to["direction"] = transform.direction;
  to["unit"] = transform.unit;
}

py::dict describe_level(const LevelInfo& level) {
  py::dict dict;
  dict["shape"] = level.lattice.extent;
  add_transform(dict, level.transform);
  dict["brick"] = level.lattice.brick;
  dict["shard"] = level.shard;
  return dict;
}

}  // namespace

/// A float where it is exact, else an int.
py::object describe(const SampleValue& value) {
  const double number = value;
  if (value == number || std::isnan(number)) return py::float_(number);
  if (const auto integer = value.as_signed()) return py::int_(*integer);
  return py::int_(value.as_unsigned().value_or(0));
}

/// {label: {"name": …, "colour": …}}, None of what is no label image.
py::object describe(const std::optional<LabelTable>& labels) {
  if (!labels) return py::none();
  py::dict table;
  for (const LabelProperties& properties : *labels) {
    py::dict entry;
    if (!properties.name.empty()) entry["name"] = properties.name;
    if (properties.colour) {
      const auto& c = *properties.colour;
      entry["colour"] = py::make_tuple(c[0], c[1], c[2], c[3]);
    }
    table[py::cast(properties.label)] = entry;
  }
  return table;
}

py::dict describe(const StoreInfo& info) {
  py::list levels;
  for (const LevelInfo& level : info.levels) levels.append(describe_level(level));
  py::dict dict;
  dict["path"] = info.name;
  dict["shape"] = info.levels.front().lattice.extent;
  dict["dtype"] = info.stored_type;
  add_transform(dict, info.levels.front().transform);
  dict["levels"] = levels;
  dict["codec"] = info.codec;
  dict["fill_value"] = describe(info.fill_value);
  dict["grid_class"] = info.grid_class;
  dict["grid_name"] = info.grid_name;
  dict["labels"] = describe(info.labels);
  dict["is_store"] = info.ours;
  return dict;
}

py::dict describe(const VolumeInfo& info) {
  py::dict dict;
  dict["path"] = info.name;
  dict["shape"] = info.extent;
  dict["dtype"] = info.type;
  add_transform(dict, info.transform);
  dict["levels"] = py::list();
  dict["codec"] = py::none();
  dict["fill_value"] = describe(info.fill_value);
  dict["grid_class"] = info.grid_class;
  dict["grid_name"] = info.grid_name;
  dict["labels"] = describe(info.labels);
  dict["is_store"] = false;
  return dict;
}

py::object describe(const std::optional<CodecSample>& sample) {
  if (!sample) return py::none();
  return py::dict(py::arg("bricks") = sample->bricks, py::arg("bytes") = sample->bytes,
                  py::arg("zstd_bytes") = sample->zstd_bytes,
                  py::arg("packed_bytes") = sample->packed_bytes,
                  py::arg("zstd_decode_seconds") = sample->zstd_seconds,
                  py::arg("packed_decode_seconds") = sample->packed_seconds);
}

py::dict describe(const ConvertReport& report) {
  return py::dict(
      py::arg("bytes_in") = report.bytes_in, py::arg("bytes_out") = report.bytes_out,
      py::arg("levels") = report.levels, py::arg("bricks") = report.bricks,
      py::arg("bricks_absent") = report.bricks_absent, py::arg("bricks_kept") = report.bricks_kept,
      py::arg("index_bytes") = report.index_bytes, py::arg("seconds") = report.seconds,
      py::arg("codec") = report.codec, py::arg("codec_sample") = describe(report.codec_sample));
}

}  // namespace isobrick::python

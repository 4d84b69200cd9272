#include "bricks/zarr/ome_transformations.h"

#include <fmt/format.h>

#include <cmath>

namespace isobrick::inline v0 {
namespace {

// Zarr's axes are z, y, x, after others; ours are x, y, z.
std::size_t place_of(int axis, std::size_t axes) {
  return axes - 1 - static_cast<std::size_t>(axis);
}

Vec3d parse_vector(const JsonReader& json, std::size_t axes) {
  if (json.array_size() != axes) json.damaged(fmt::format("must have {} numbers", axes));
  Vec3d result;
  for (int axis = 0; axis < 3; ++axis) result[axis] = json.at(place_of(axis, axes)).number();
  return result;
}

AffineMap parse_scale(const JsonReader& json, std::size_t axes) {
  const Vec3d scale = parse_vector(json.at("scale"), axes);
  AffineMap map;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(scale[axis] > 0)) json.damaged("scale must be positive");
    map.matrix[static_cast<std::size_t>(4 * axis)] = scale[axis];
  }
  return map;
}

AffineMap parse_translation(const JsonReader& json, std::size_t axes) {
  AffineMap map;
  map.offset = parse_vector(json.at("translation"), axes);
  return map;
}

// Rows of as many numbers as there are axes and, if it has an offset, one more.
AffineMap parse_matrix(const JsonReader& rows, std::size_t axes, bool has_offset) {
  const std::size_t columns = axes + (has_offset ? 1 : 0), leading = axes - 3;
  if (rows.array_size() != axes) rows.damaged(fmt::format("must have {} rows", axes));
  AffineMap map;
  for (std::size_t i = 0; i < axes; ++i) {
    const JsonReader row = rows.at(i);
    if (row.array_size() != columns) row.damaged(fmt::format("must have {} numbers", columns));
    for (std::size_t j = 0; j < columns; ++j) {
      const double value = row.at(j).number();
      const bool row_of_space = i >= leading, column_of_space = j >= leading && j < axes;
      if (j < axes && row_of_space != column_of_space && value != 0)
        row.unsupported("a matrix that mixes space with other axes is not supported");
      if (!row_of_space) continue;
      if (column_of_space) map.matrix[3 * (axes - 1 - i) + (axes - 1 - j)] = value;
      if (j == axes) map.offset[static_cast<int>(axes - 1 - i)] = value;
    }
  }
  return map;
}

}  // namespace

AffineMap then(const AffineMap& first, const AffineMap& second) {
  AffineMap both;
  const auto& a = second.matrix;
  for (std::size_t row = 0; row < 3; ++row) {
    double offset = 0;
    for (std::size_t column = 0; column < 3; ++column) {
      double sum = 0;
      for (std::size_t k = 0; k < 3; ++k) sum += a[3 * row + k] * first.matrix[3 * k + column];
      both.matrix[3 * row + column] = sum;
      offset += a[3 * row + column] * first.offset[static_cast<int>(column)];
    }
    both.offset[static_cast<int>(row)] = offset + second.offset[static_cast<int>(row)];
  }
  return both;
}

AffineMap parse_transformation(const JsonReader& json, std::size_t axes) {
  const std::string type = json.string_at("type");
  if (type == "identity") return {};
  const bool known = type == "scale" || type == "translation" || type == "rotation" ||
                     type == "affine" || type == "sequence";
  if (!known) json.unsupported(fmt::format("transformation '{}' is not supported", type));
  if (type == "sequence") {
    AffineMap map;
    const JsonReader list = json.at("transformations");
    for (std::size_t i = 0; i < list.array_size(); ++i)
      map = then(map, parse_transformation(list.at(i), axes));
    return map;
  }
  if (!json.has(type.c_str()) && json.has("path"))
    json.unsupported(
        fmt::format("transformation '{}' whose numbers are an array is not supported", type));
  if (type == "scale") return parse_scale(json, axes);
  if (type == "translation") return parse_translation(json, axes);
  return parse_matrix(json.at(type.c_str()), axes, type == "affine");
}

AffineMap parse_scale_and_translation(const JsonReader& list, std::size_t axes) {
  AffineMap map;
  bool scaled = false, translated = false;
  for (std::size_t i = 0; i < list.array_size(); ++i) {
    const JsonReader item = list.at(i);
    const std::string type = item.string_at("type");
    if (type == "scale") {
      if (scaled) list.damaged("has two scales: OME-Zarr allows one");
      if (translated) list.damaged("has a translation before its scale");
      scaled = true;
      map = then(map, parse_scale(item, axes));
    } else if (type == "translation") {
      if (translated) list.damaged("has two translations: OME-Zarr allows one");
      translated = true;
      map = then(map, parse_translation(item, axes));
    } else if (type != "identity") {
      item.unsupported(
          fmt::format("transformation '{}' is not supported before OME-Zarr 0.6", type));
    }
  }
  return map;
}

Transform to_transform(const JsonReader& json, const AffineMap& map) {
  Transform transform;
  transform.origin = map.offset;
  for (int axis = 0; axis < 3; ++axis) {
    const auto column = static_cast<std::size_t>(axis);
    const double a = map.matrix[column], b = map.matrix[column + 3], c = map.matrix[column + 6];
    const double length = std::hypot(a, b, c);
    if (!(length > 0) || !std::isfinite(length) || !std::isfinite(map.offset[axis]))
      json.damaged("scale must be finite and positive, translation finite");
    transform.spacing[axis] = length;
    for (std::size_t row = 0; row < 3; ++row)
      transform.direction[column + 3 * row] = map.matrix[column + 3 * row] / length;
  }
  if (!is_orthonormal(transform.direction))
    json.unsupported(
        "a transformation that shears (an 'affine' whose axes are not at right angles) is not "
        "supported");
  return transform;
}

std::string coordinate_system(const JsonReader& reference) {
  if (reference.raw().is_string()) return reference.string();
  return reference.string_at(reference.has("name") ? "name" : "path");
}

bool is_orthonormal(const std::array<double, 9>& direction) {
  constexpr double tolerance = 1e-4;
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = a; b < 3; ++b) {
      double product = 0;
      for (std::size_t row = 0; row < 3; ++row)
        product += direction[3 * row + a] * direction[3 * row + b];
      if (!(std::abs(product - (a == b ? 1 : 0)) <= tolerance)) return false;
    }
  return true;
}

}  // namespace isobrick

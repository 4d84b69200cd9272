#include "io/meshes/gltf/glb_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "core/box_union.h"
#include "core/length_unit.h"
#include "io/meshes/gltf/meshopt_codec.h"

namespace isobrick::inline v0 {
namespace {

using nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");

constexpr int kFloat = 5126, kUint32 = 5125, kUint16 = 5123, kInt16 = 5122;
constexpr int kArrayBuffer = 34962, kElementBuffer = 34963, kTriangles = 4;
constexpr double kGridSteps = 65535;

/// Three numbers of 16 bits and two bytes that align the next.
using Quantized = std::array<std::uint16_t, 4>;

Quantized on_grid(Vec3f whole) {
  return {static_cast<std::uint16_t>(whole.x), static_cast<std::uint16_t>(whole.y),
          static_cast<std::uint16_t>(whole.z), 0};
}

/// Fractions of 32767, two's complement.
Quantized signed_fractions(Vec3f v) {
  Quantized fractions{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double part = std::clamp(double{v[static_cast<int>(axis)]}, -1.0, 1.0);
    fractions[axis] =
        std::bit_cast<std::uint16_t>(static_cast<std::int16_t>(std::nearbyint(part * 32767)));
  }
  return fractions;
}

/// In linear light, and the opacity.
using LinearColour = std::array<std::uint16_t, 4>;

LinearColour linear_colour(VertexColour colour) {
  static const std::array<std::uint16_t, 256> table = [] {
    std::array<std::uint16_t, 256> values{};
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = static_cast<std::uint16_t>(
          std::lround(linear_light(static_cast<std::uint8_t>(i)) * 65535));
    return values;
  }();
  return {table[colour[0]], table[colour[1]], table[colour[2]], 65535};
}

ordered_json triple(Vec3f v) {
  // Every float is a double, whose shortest decimals the JSON holds.
  return {double{v.x}, double{v.y}, double{v.z}};
}

ordered_json whole_triple(Vec3f v) {
  return {static_cast<int>(v.x), static_cast<int>(v.y), static_cast<int>(v.z)};
}

/// As glTF has names of its own users' attributes.
std::string attribute_name(std::string name) {
  for (char& c : name)
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  return "_" + name;
}

/// The node of the mesh, which leads to metres.
ordered_json node_of(const GlbVertices& vertices) {
  ordered_json node;
  if (!vertices.name.empty()) node["name"] = vertices.name;
  node["mesh"] = 0;
  const double metres = unit_ratio(vertices.unit, "meter").value_or(1);
  const double scale = metres * (vertices.quantized ? vertices.step : 1);
  const Vec3d origin = vertices.quantized ? vertices.origin * metres : Vec3d{};
  if (vertices.turns_z_up) {
    // (x, y, z) becomes (x, z, -y), exactly: a quaternion of such an angle is rounded.
    node["matrix"] = {scale, 0,     0, 0, 0,        0,        -scale,       0,
                      0,     scale, 0, 0, origin.x, origin.z, 0 - origin.y, 1};
    return node;
  }
  if (vertices.quantized) node["translation"] = {origin.x, origin.y, origin.z};
  if (scale != 1) node["scale"] = {scale, scale, scale};
  return node;
}

ordered_json material(const std::array<double, 3>& colour) {
  return {{"pbrMetallicRoughness",
           {{"baseColorFactor", {colour[0], colour[1], colour[2], 1}},
            {"metallicFactor", 0},
            {"roughnessFactor", 0.7}}},
          // A surface ends where the volume does, and is then seen from behind.
          {"doubleSided", true}};
}

/// The scene's lists, kept apart: adding to an ordered object moves what it holds.
struct Lists {
  ordered_json buffers = ordered_json::array(), views = ordered_json::array(),
               accessors = ordered_json::array(), primitives = ordered_json::array();

  void add(const GlbVertices& form, const GlbPrimitive& primitive);

 private:
  void add_views(const GlbVertices& form, const GlbPrimitive& primitive);
  void add_compressed_views(const GlbVertices& form, const GlbPrimitive& primitive);
  std::size_t compressed_buffer(const GlbPrimitive& primitive);
};

void Lists::add_views(const GlbVertices& form, const GlbPrimitive& primitive) {
  const std::size_t buffer = buffers.size();
  ordered_json object{{"byteLength", primitive.bytes()}};
  if (!primitive.uri.empty()) object["uri"] = primitive.uri;
  buffers.push_back(std::move(object));
  views.push_back({{"buffer", buffer},
                   {"byteLength", primitive.vertex_bytes},
                   {"byteStride", form.row_bytes()},
                   {"target", kArrayBuffer}});
  views.push_back({{"buffer", buffer},
                   {"byteOffset", primitive.vertex_bytes},
                   {"byteLength", primitive.bytes() - primitive.vertex_bytes},
                   {"target", kElementBuffer}});
}

/// The buffer with the primitive's bytes, which is made or grows.
std::size_t Lists::compressed_buffer(const GlbPrimitive& primitive) {
  std::uint64_t end = 0;
  for (const BufferRange& range : primitive.compressed)
    end = std::max(end, (range.offset + range.bytes + 3) / 4 * 4);
  if (primitive.uri.empty() && !buffers.empty()) {
    buffers[0]["byteLength"] = std::max(buffers[0]["byteLength"].get<std::uint64_t>(), end);
    return 0;
  }
  ordered_json object{{"byteLength", end}};
  if (!primitive.uri.empty()) object["uri"] = primitive.uri;
  buffers.push_back(std::move(object));
  return buffers.size() - 1;
}

/// A view for each field and one of triangles. They lie in a buffer without bytes, as the extension
/// has it, and name where their compressed bytes are.
void Lists::add_compressed_views(const GlbVertices& form, const GlbPrimitive& primitive) {
  const std::size_t source = compressed_buffer(primitive), decoded = buffers.size();
  buffers.push_back({{"byteLength", primitive.bytes()},
                     {"extensions", {{kMeshoptExtension, {{"fallback", true}}}}}});
  std::uint64_t offset = 0;
  const auto add_view = [&](std::uint64_t count, std::uint64_t stride, bool is_vertices,
                            const BufferRange& range) {
    ordered_json view{{"buffer", decoded}, {"byteOffset", offset}, {"byteLength", count * stride}};
    if (is_vertices) view["byteStride"] = stride;
    view["target"] = is_vertices ? kArrayBuffer : kElementBuffer;
    view["extensions"][kMeshoptExtension] = {{"buffer", source},
                                             {"byteOffset", range.offset},
                                             {"byteLength", range.bytes},
                                             {"byteStride", stride},
                                             {"mode", is_vertices ? "ATTRIBUTES" : "TRIANGLES"},
                                             {"count", count}};
    views.push_back(std::move(view));
    offset += count * stride;
  };
  auto range = primitive.compressed.begin();
  for (const GlbField& field : form.fields())
    add_view(primitive.vertices, field.bytes, true, *range++);
  add_view(3 * primitive.triangles, sizeof(std::uint32_t), false, *range);
}

void Lists::add(const GlbVertices& form, const GlbPrimitive& primitive) {
  const bool in_rows = primitive.compressed.empty();
  std::size_t view = views.size();
  if (in_rows)
    add_views(form, primitive);
  else
    add_compressed_views(form, primitive);
  ordered_json attributes;
  for (const GlbField& field : form.fields()) {
    attributes[field.name] = accessors.size();
    ordered_json accessor{{"bufferView", view}};
    if (in_rows && field.offset > 0) accessor["byteOffset"] = field.offset;
    accessor["componentType"] = field.component;
    accessor["count"] = primitive.vertices;
    accessor["type"] = field.type;
    if (field.offset == 0) {
      const auto of_positions = form.quantized ? whole_triple : triple;
      accessor["min"] = of_positions(primitive.bounds.lo);
      accessor["max"] = of_positions(primitive.bounds.hi);
    }
    if (field.normalized) accessor["normalized"] = true;
    accessors.push_back(std::move(accessor));
    if (!in_rows) ++view;
  }
  const std::size_t indices = accessors.size();
  accessors.push_back({{"bufferView", in_rows ? view + 1 : view},
                       {"componentType", kUint32},
                       {"count", 3 * primitive.triangles},
                       {"type", "SCALAR"}});
  primitives.push_back({{"attributes", std::move(attributes)},
                        {"indices", indices},
                        {"material", 0},
                        {"mode", kTriangles}});
}

}  // namespace

double linear_light(std::uint8_t srgb) {
  const double value = srgb / 255.0;
  const double linear = value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
  return std::round(linear * 1e4) / 1e4;
}

void Bounds3f::include(std::span<const Vec3f> positions) {
  if (positions.empty()) return;
  if (std::exchange(empty, false)) lo = hi = positions.front();
  for (const Vec3f& p : positions) widen(lo, hi, p, p);
}

void GlbVertices::set_grid(const Bounds3f& bounds) {
  double longest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    origin[axis] = bounds.lo[axis];
    longest = std::max(longest, double{bounds.hi[axis]} - bounds.lo[axis]);
  }
  step = longest > 0 ? longest / kGridSteps : 1;
}

void Bounds3f::include(const Bounds3f& other) {
  if (!other.empty) include(std::array{other.lo, other.hi});
}

std::size_t GlbVertices::vector_bytes() const {
  return (normals ? 2 : 1) * (quantized ? sizeof(Quantized) : sizeof(Vec3f));
}

std::size_t GlbVertices::float_row_bytes() const {
  return (normals ? 2 : 1) * sizeof(Vec3f) + attributes.size() * sizeof(float) +
         (colours ? sizeof(VertexColour) : 0);
}

std::size_t GlbVertices::row_bytes() const {
  return vector_bytes() + attributes.size() * sizeof(float) + (colours ? sizeof(LinearColour) : 0);
}

std::vector<GlbField> GlbVertices::fields() const {
  const std::size_t vector = quantized ? sizeof(Quantized) : sizeof(Vec3f);
  std::vector<GlbField> list{
      {.name = "POSITION", .bytes = vector, .component = quantized ? kUint16 : kFloat}};
  if (normals)
    list.push_back({.name = "NORMAL",
                    .offset = vector,
                    .bytes = vector,
                    .component = quantized ? kInt16 : kFloat,
                    .normalized = quantized});
  for (const std::string& attribute : attributes)
    list.push_back({.name = attribute_name(attribute),
                    .offset = list.back().offset + list.back().bytes,
                    .bytes = sizeof(float),
                    .component = kFloat,
                    .type = "SCALAR"});
  if (colours)
    list.push_back({.name = "COLOR_0",
                    .offset = list.back().offset + list.back().bytes,
                    .bytes = sizeof(LinearColour),
                    .component = kUint16,
                    .type = "VEC4",
                    .normalized = true});
  return list;
}

Bounds3f GlbVertices::bounds_of_positions(std::span<const std::byte> positions) const {
  Bounds3f bounds;
  const std::size_t stride = quantized ? sizeof(Quantized) : sizeof(Vec3f);
  for (std::size_t at = 0; at < positions.size(); at += stride) {
    Vec3f position;
    if (quantized) {
      Quantized whole;
      std::memcpy(whole.data(), positions.data() + at, sizeof(whole));
      for (std::size_t axis = 0; axis < 3; ++axis) position[static_cast<int>(axis)] = whole[axis];
    } else {
      std::memcpy(&position, positions.data() + at, sizeof(position));
    }
    bounds.include({&position, 1});
  }
  return bounds;
}

Vec3f GlbVertices::stored(Vec3f position) const {
  if (!quantized) return position;
  Vec3f whole;
  for (int axis = 0; axis < 3; ++axis)
    whole[axis] = static_cast<float>(std::clamp(
        std::nearbyint((double{position[axis]} - origin[axis]) / step), 0.0, kGridSteps));
  return whole;
}

Bounds3f GlbVertices::stored(const Bounds3f& bounds) const {
  return {stored(bounds.lo), stored(bounds.hi), bounds.empty};
}

Bounds3f GlbVertices::store(std::span<const std::byte> rows, std::byte* to) const {
  const std::size_t from_bytes = float_row_bytes(), numbers = attributes.size() * sizeof(float);
  const std::size_t from_vectors = (normals ? 2 : 1) * sizeof(Vec3f);
  const std::size_t count = rows.size() / from_bytes;
  Bounds3f bounds;
  for (std::size_t i = 0; i < count; ++i, to += row_bytes()) {
    std::array<Vec3f, 2> row;
    const std::byte* from = rows.data() + i * from_bytes;
    std::memcpy(row.data(), from, from_vectors);
    row[0] = stored(row[0]);
    bounds.include({&row[0], 1});
    if (quantized) {
      const std::array<Quantized, 2> packed{on_grid(row[0]), signed_fractions(row[1])};
      std::memcpy(to, packed.data(), vector_bytes());
    } else {
      std::memcpy(to, row.data(), vector_bytes());
    }
    std::memcpy(to + vector_bytes(), from + from_vectors, numbers);
    if (!colours) continue;
    VertexColour srgb;
    std::memcpy(&srgb, from + from_vectors + numbers, sizeof(srgb));
    const LinearColour linear = linear_colour(srgb);
    std::memcpy(to + vector_bytes() + numbers, linear.data(), sizeof(linear));
  }
  return bounds;
}

Bounds3f GlbVertices::append(FileWriter& out, std::span<const std::byte> rows) const {
  // Colours take more bytes stored than in rows.
  const std::size_t most = FileWriter::kBuffer / std::max(row_bytes(), float_row_bytes());
  Bounds3f bounds;
  while (!rows.empty()) {
    const std::size_t count = std::min(most, rows.size() / float_row_bytes());
    const auto some = rows.first(count * float_row_bytes());
    bounds.include(store(some, out.reserve(count * row_bytes())));
    out.commit(count * row_bytes());
    rows = rows.subspan(some.size());
  }
  return bounds;
}

std::string glb_json(const GlbVertices& vertices, std::span<const GlbPrimitive> primitives) {
  ordered_json scene{{"asset", {{"version", "2.0"}, {"generator", "Isobrick"}}}};
  if (!vertices.unit.empty()) scene["asset"]["extras"] = {{"unit", vertices.unit}};
  scene["scene"] = 0;
  scene["scenes"] = ordered_json::array({ordered_json::object()});
  if (primitives.empty()) return scene.dump();
  scene["scenes"][0]["nodes"] = ordered_json::array({0});
  ordered_json extensions = ordered_json::array();
  if (vertices.quantized) extensions.push_back("KHR_mesh_quantization");
  if (!primitives.front().compressed.empty()) extensions.push_back(kMeshoptExtension);
  if (!extensions.empty())
    for (const char* key : {"extensionsUsed", "extensionsRequired"}) scene[key] = extensions;
  Lists lists;
  for (const GlbPrimitive& primitive : primitives) lists.add(vertices, primitive);
  scene["nodes"] = ordered_json::array({node_of(vertices)});
  scene["materials"] = ordered_json::array(
      {material(vertices.colours ? std::array<double, 3>{1, 1, 1} : vertices.colour)});
  ordered_json mesh;
  if (!vertices.name.empty()) mesh["name"] = vertices.name;
  mesh["primitives"] = std::move(lists.primitives);
  scene["meshes"] = ordered_json::array({std::move(mesh)});
  scene["accessors"] = std::move(lists.accessors);
  scene["bufferViews"] = std::move(lists.views);
  scene["buffers"] = std::move(lists.buffers);
  // Names may come from files of others.
  return scene.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

std::string glb_start(std::string json, std::uint64_t buffer_bytes) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const std::uint64_t buffer_part = buffer_bytes > 0 ? 8 + buffer_bytes : 0;
  std::string text;
  const auto add = [&text](std::uint64_t number) {
    const auto word = static_cast<std::uint32_t>(number);
    char bytes[sizeof(word)];
    std::memcpy(bytes, &word, sizeof(word));
    text.append(bytes, sizeof(word));
  };
  text += "glTF";
  add(2);
  add(12 + 8 + json.size() + buffer_part);
  add(json.size());
  text += "JSON" + json;
  if (buffer_bytes > 0) {
    add(buffer_bytes);
    text.append("BIN\0", 4);
  }
  return text;
}

std::string percent_encoded(std::string_view text) {
  std::string encoded;
  for (const char c : text) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
                       std::string_view("-._~/").find(c) != std::string_view::npos;
    encoded += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return encoded;
}

}  // namespace isobrick

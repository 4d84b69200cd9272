#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "core/vectors.h"
#include "io/meshes/readers/gltf_buffers.h"
#include "io/meshes/readers/mesh_parts_reader.h"
#include "io/meshes/readers/mesh_readers.h"

namespace isobrick::inline v0 {
namespace {

using nlohmann::json;

constexpr std::uint32_t kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;
constexpr std::size_t kMaxJson = std::size_t{64} << 20;
/// Of the values of the scene: enough for some 100,000 meshes and nodes.
constexpr std::size_t kMaxValueBytes = std::size_t{128} << 20;
constexpr int kMaxDepth = 64;

std::uint32_t word_at(std::span<const std::byte> bytes, std::size_t at) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes.data() + at, sizeof(word));
  return word;
}

/// Three indices after the other.
class GltfTriangles final : public TriangleReader {
 public:
  GltfTriangles(const std::byte* first, NumberKind kind, std::uint64_t triangles)
      : at_(first), kind_(kind), left_(triangles) {}

  bool next(std::array<std::uint64_t, 3>& triangle) override {
    if (left_ == 0) return false;
    --left_;
    for (std::uint64_t& vertex : triangle) {
      vertex = static_cast<std::uint64_t>(load_number(at_, kind_, false));
      at_ += size_of(kind_);
    }
    return true;
  }

 private:
  const std::byte* at_;
  NumberKind kind_;
  std::uint64_t left_;
};

/// Vertices in their own order, where there are no indices.
class UnindexedTriangles final : public TriangleReader {
 public:
  explicit UnindexedTriangles(std::uint64_t triangles) : triangles_(triangles) {}
  bool next(std::array<std::uint64_t, 3>& triangle) override {
    if (done_ == triangles_) return false;
    triangle = {3 * done_, 3 * done_ + 1, 3 * done_ + 2};
    ++done_;
    return true;
  }

 private:
  std::uint64_t triangles_, done_ = 0;
};

WorldMatrix product(const WorldMatrix& a, const WorldMatrix& b) {
  WorldMatrix m;
  for (std::size_t i = 0; i < 3; ++i) m.columns[i] = a.turn(b.columns[i]);
  m.columns[3] = a.move(b.columns[3]);
  return m;
}

class GltfReader {
 public:
  /// `in_chunks`: a GLB, and not the scene alone.
  GltfReader(const std::string& path, std::shared_ptr<MappedFile> file, bool in_chunks)
      : path_(path), bytes_(file->bytes()), in_chunks_(in_chunks), buffers_(path) {
    keep_.push_back(std::move(file));
  }

  std::unique_ptr<MeshFile> read() {
    try {
      if (in_chunks_)
        read_chunks();
      else
        read_scene(bytes_);
      if (!root_.is_object()) fail("its scene is no object");
      if (root_.contains("extensionsRequired"))
        for (const json& name : root_.at("extensionsRequired"))
          if (name != "KHR_mesh_quantization" && name != kMeshoptExtension)
            fail(fmt::format("it needs the extension {}, which is not read", name.dump()));
      const WorldMatrix root = choose_unit();
      if (root_.contains("scenes")) {
        const json& scene = item("scenes", root_.value("scene", std::uint64_t{0}));
        if (scene.contains("nodes"))
          for (const json& node : scene.at("nodes")) add_node(index(node), root, 0);
      }
    } catch (const json::exception& error) {
      fail(fmt::format("its scene: {}", error.what()));
    }
    keep_.insert(keep_.end(), buffers_.files().begin(), buffers_.files().end());
    return std::make_unique<IndexedMeshFile>(path_, std::move(parts_), std::move(keep_),
                                             std::move(unit_));
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { fail_gltf(path_, what); }

  void read_chunks() {
    constexpr std::size_t start = 12, head = 8;
    if (bytes_.size() < start + head) fail("it ends within its header");
    if (word_at(bytes_, 4) != 2) fail(fmt::format("its version is {}", word_at(bytes_, 4)));
    bool has_binary = false;
    for (std::size_t at = start; at + head <= bytes_.size();) {
      const std::size_t size = word_at(bytes_, at), kind = word_at(bytes_, at + 4);
      if (size > bytes_.size() - at - head)
        fail(fmt::format("its part at offset {} goes beyond its end", at));
      const auto chunk = bytes_.subspan(at + head, size);
      if (at == start) {
        if (kind != kJsonChunk) fail("it does not begin with a scene");
        read_scene(chunk);
      } else if (kind == kBinaryChunk && !has_binary) {
        buffers_.set_binary(chunk);
        has_binary = true;
      }
      at += head + (size + 3) / 4 * 4;
    }
  }

  /// Parses the scene. Its values may take a hundred times the memory of their text, so the parser
  /// stops where they become too many, or their levels, each of which takes some of the stack.
  void read_scene(std::span<const std::byte> chunk) {
    if (chunk.size() > kMaxJson)
      fail(fmt::format("its scene takes {} bytes, more than {} MiB", chunk.size(), kMaxJson >> 20));
    const auto* text = reinterpret_cast<const char*>(chunk.data());
    using Event = json::parse_event_t;
    std::size_t bytes = 0;
    root_ = json::parse(text, text + chunk.size(), [&](int depth, Event event, json&) {
      const bool opens = event == Event::object_start || event == Event::array_start;
      if (opens && depth >= kMaxDepth)
        fail(fmt::format("its scene is nested more than {} levels deep", kMaxDepth));
      bytes += bytes_of(event);
      if (bytes > kMaxValueBytes)
        fail(fmt::format("its scene has so many values that they take more than {} MiB",
                         kMaxValueBytes >> 20));
      return true;
    });
  }

  /// About the memory of a value in a list or an object, text aside.
  static std::size_t bytes_of(json::parse_event_t event) {
    using Event = json::parse_event_t;
    switch (event) {
      case Event::object_start:
      case Event::array_start: return 96;
      case Event::key: return 96;
      case Event::value: return 32;
      default: return 0;
    }
  }

  /// Finds the unit of the coordinates, and what takes the scene to it. glTF measures in metres;
  /// scenes of ours also name the unit of the volume, or had none.
  WorldMatrix choose_unit() {
    const json asset = root_.value("asset", json::object());
    const json extras = asset.value("extras", json::object());
    if (extras.is_object() && extras.contains("unit") && extras.at("unit").is_string())
      unit_ = unit_name(extras.at("unit").get<std::string>());
    WorldMatrix to_unit;
    if (unit_.empty()) {
      if (asset.value("generator", "") != "Isobrick") unit_ = "meter";
      return to_unit;
    }
    const double metres = *unit_ratio(unit_, "meter");
    for (std::size_t axis = 0; axis < 3; ++axis)
      to_unit.columns[axis] = to_unit.columns[axis] * (1 / metres);
    return to_unit;
  }

  /// A whole number that counts or numbers something.
  std::uint64_t index(const json& value) const {
    if (!value.is_number_unsigned())
      fail(fmt::format("'{}' is no number of an item", value.dump()));
    return value.get<std::uint64_t>();
  }
  std::uint64_t whole(const json& object, const char* key, std::uint64_t otherwise) const {
    return object.contains(key) ? index(object.at(key)) : otherwise;
  }
  const json& item(const char* list, std::uint64_t number) const {
    const json& all = root_.at(list);
    if (!all.is_array() || number >= all.size())
      fail(fmt::format("{} {} is not there", list, number));
    return all[static_cast<std::size_t>(number)];
  }

  std::array<double, 16> numbers(const json& list, std::size_t count) const {
    std::array<double, 16> values{};
    if (!list.is_array() || list.size() != count) fail("a node's place is damaged");
    for (std::size_t i = 0; i < count; ++i) {
      values[i] = list[i].get<double>();
      if (!std::isfinite(values[i])) fail("a node's place is damaged");
    }
    return values;
  }

  WorldMatrix matrix_of(const json& node) const {
    WorldMatrix m;
    if (node.contains("matrix")) {
      const auto v = numbers(node.at("matrix"), 16);
      for (std::size_t c = 0; c < 4; ++c) m.columns[c] = {v[4 * c], v[4 * c + 1], v[4 * c + 2]};
      return m;
    }
    if (node.contains("rotation")) {
      const auto q = numbers(node.at("rotation"), 4);
      const Vec3d axis{q[0], q[1], q[2]};
      const double w = q[3];
      for (std::size_t c = 0; c < 3; ++c) {
        Vec3d& v = m.columns[c];
        const Vec3d t = cross(axis, v) * 2.0;
        v = v + t * w + cross(axis, t);
      }
    }
    if (node.contains("scale")) {
      const auto s = numbers(node.at("scale"), 3);
      for (std::size_t c = 0; c < 3; ++c) m.columns[c] = m.columns[c] * s[c];
    }
    if (node.contains("translation")) {
      const auto t = numbers(node.at("translation"), 3);
      m.columns[3] = {t[0], t[1], t[2]};
    }
    return m;
  }

  void add_node(std::uint64_t number, const WorldMatrix& parent, int depth) {
    // A tree cannot be deeper than it has nodes; a ring would have no end.
    if (depth > kMaxDepth || ++nodes_seen_ > root_.at("nodes").size())
      fail("its nodes are no tree");
    const json& node = item("nodes", number);
    const WorldMatrix here = product(parent, matrix_of(node));
    if (node.contains("mesh"))
      for (const json& primitive : item("meshes", index(node.at("mesh"))).at("primitives"))
        add_primitive(primitive, here);
    if (node.contains("children"))
      for (const json& child : node.at("children")) add_node(index(child), here, depth + 1);
  }

  void add_primitive(const json& primitive, const WorldMatrix& to_world) {
    if (const auto mode = whole(primitive, "mode", 4); mode != 4)
      fail(fmt::format("it has primitives of mode {}; only triangles (4) are drawn", mode));
    if (primitive.contains("extensions") &&
        primitive.at("extensions").contains("KHR_draco_mesh_compression"))
      fail("its meshes are compressed");
    const json& attributes = primitive.at("attributes");
    IndexedPart part{.to_world = to_world};
    const auto positions = vertex_field(index(attributes.at("POSITION")));
    part.positions = positions.first;
    part.vertices = positions.second;
    if (attributes.contains("NORMAL")) {
      const auto normals = vertex_field(index(attributes.at("NORMAL")));
      if (normals.second != part.vertices) fail("a mesh has more positions than normals, or fewer");
      part.normals = normals.first;
    }
    if (attributes.contains("COLOR_0")) {
      const auto colours = vertex_field(index(attributes.at("COLOR_0")), true);
      if (colours.second != part.vertices) fail("a mesh has more positions than colours, or fewer");
      part.colours = colours.first;
      part.linear_colours = true;
    }
    if (primitive.contains("indices"))
      add_indices(part, index(primitive.at("indices")));
    else {
      part.faces = part.vertices / 3;
      part.open_triangles = [count = part.faces] {
        return std::make_unique<UnindexedTriangles>(count);
      };
    }
    parts_.push_back(std::move(part));
  }

  void add_indices(IndexedPart& part, std::uint64_t number) {
    const json& accessor = item("accessors", number);
    const NumberKind kind = kind_of(accessor);
    if (kind != NumberKind::u8 && kind != NumberKind::u16 && kind != NumberKind::u32)
      fail("its triangles are no whole numbers");
    const Place place = place_of(accessor, size_of(kind));
    if (place.stride != size_of(kind)) fail("its triangles do not lie side by side");
    part.faces = place.count / 3;
    part.open_triangles = [first = place.first, kind, count = part.faces] {
      return std::make_unique<GltfTriangles>(first, kind, count);
    };
  }

  NumberKind kind_of(const json& accessor) const {
    switch (index(accessor.at("componentType"))) {
      case 5120: return NumberKind::i8;
      case 5121: return NumberKind::u8;
      case 5122: return NumberKind::i16;
      case 5123: return NumberKind::u16;
      case 5125: return NumberKind::u32;
      case 5126: return NumberKind::f32;
      default: fail("it has numbers of an unknown kind");
    }
  }

  /// `or_four`: the accessor's items may have a fourth component, which is passed over.
  std::pair<VertexField, std::uint64_t> vertex_field(std::uint64_t number, bool or_four = false) {
    const json& accessor = item("accessors", number);
    const bool four = or_four && accessor.at("type") == "VEC4";
    if (accessor.at("type") != "VEC3" && !four) fail("its vertices are no triples");
    const NumberKind kind = kind_of(accessor);
    const auto size = static_cast<std::uint32_t>(size_of(kind));
    const Place place = place_of(accessor, (four ? 4 : 3) * size);
    VertexField field{.first = place.first,
                      .stride = place.stride,
                      .offsets = {0, size, 2 * size},
                      .kinds = {kind, kind, kind}};
    if (accessor.value("normalized", false) && kind != NumberKind::f32) {
      const bool is_signed = kind == NumberKind::i8 || kind == NumberKind::i16;
      field.scale = 1 / (std::ldexp(1.0, static_cast<int>(8 * size) - (is_signed ? 1 : 0)) - 1);
    }
    return {field, place.count};
  }

  struct Place {
    const std::byte* first;
    std::uint64_t stride, count;
  };

  /// Where an accessor's items of `size` bytes are, all of them within their buffer.
  Place place_of(const json& accessor, std::uint64_t size) {
    if (accessor.contains("sparse")) fail("it has sparse accessors, which are not read");
    const std::uint64_t count = index(accessor.at("count"));
    const std::uint64_t view_number = index(accessor.at("bufferView"));
    const json& view = item("bufferViews", view_number);
    const std::span<const std::byte> bytes = view_bytes(view, view_number);
    const std::uint64_t inner = whole(accessor, "byteOffset", 0), length = bytes.size();
    const std::uint64_t stride = whole(view, "byteStride", size);
    if (stride < size || stride > 1024)
      fail(fmt::format("a view has a stride of {} bytes", stride));
    if (count > 0 &&
        (inner > length || size > length - inner || (length - inner - size) / stride < count - 1))
      fail(fmt::format("an accessor of {} items goes beyond its view of {} bytes", count, length));
    return {bytes.data() + inner, stride, count};
  }

  std::span<const std::byte> view_bytes(const json& view, std::uint64_t number) {
    if (!view.contains("extensions") || !view.at("extensions").contains(kMeshoptExtension))
      return bytes_of_buffer(view);
    const json& packed = view.at("extensions").at(kMeshoptExtension);
    const std::string mode = packed.at("mode"), filter = packed.value("filter", "NONE");
    const MeshoptView form{mode, filter, index(packed.at("count")), index(packed.at("byteStride"))};
    if (index(view.at("byteLength")) / std::max<std::uint64_t>(form.stride, 1) != form.count)
      fail("a compressed view has another size than what it holds");
    return buffers_.decode(number, form, bytes_of_buffer(packed));
  }

  /// The bytes that a view, or the extension of a compressed one, names.
  std::span<const std::byte> bytes_of_buffer(const json& view) {
    const std::uint64_t number = index(view.at("buffer"));
    const std::span<const std::byte> buffer = buffers_.get(item("buffers", number), number);
    const std::uint64_t offset = whole(view, "byteOffset", 0),
                        length = index(view.at("byteLength"));
    if (offset > buffer.size() || length > buffer.size() - offset)
      fail("a view goes beyond its buffer");
    return buffer.subspan(static_cast<std::size_t>(offset), static_cast<std::size_t>(length));
  }

  const std::string& path_;
  std::span<const std::byte> bytes_;
  bool in_chunks_;
  json root_;
  std::size_t nodes_seen_ = 0;
  std::string unit_;
  GltfBuffers buffers_;
  std::vector<IndexedPart> parts_;
  std::vector<std::shared_ptr<const void>> keep_;
};

}  // namespace

std::unique_ptr<MeshFile> read_glb(const std::string& path, std::shared_ptr<MappedFile> file) {
  return GltfReader(path, std::move(file), true).read();
}

std::unique_ptr<MeshFile> read_gltf(const std::string& path, std::shared_ptr<MappedFile> file) {
  return GltfReader(path, std::move(file), false).read();
}

}  // namespace isobrick

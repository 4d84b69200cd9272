#include "pipeline/pieces/piece_format.h"

#include <fmt/format.h>

#include <bit>

#include <isobrick/error.h>
#include "pipeline/check_part.h"
#include "surface/surface_extractor.h"

namespace isobrick::inline v0 {
namespace {

using nlohmann::json;

static_assert(std::endian::native == std::endian::little, "pieces are written as they lie");
static_assert(sizeof(PieceStart) == 16 && sizeof(PieceTile) == 16 && sizeof(PieceEnd) == 72);

json to_json(Vec3d v) { return {v.x, v.y, v.z}; }

Vec3d vector_of(const json& v) {
  return {v.at(0).get<double>(), v.at(1).get<double>(), v.at(2).get<double>()};
}

PieceDescription header_of(const json& object) {
  PieceDescription header{piece_key_of(object), {}};
  MeshHeader& of_mesh = header.of_mesh;
  of_mesh.has_normals = header.mesh.at("normals").get<bool>();
  of_mesh.world_lo = vector_of(object.at("volume").at(0));
  of_mesh.world_hi = vector_of(object.at("volume").at(1));
  if (const json& surface = object.at("surface"); !surface.is_null())
    of_mesh.surface = MeshBounds{vector_of(surface.at(0)), vector_of(surface.at(1))};
  of_mesh.unit = object.at("unit").get<std::string>();
  header.isovalue();
  return header;
}

}  // namespace

PieceKey piece_key_of(const json& object) {
  PieceKey key;
  key.part = {object.at("part").at(0).get<std::uint32_t>(),
              object.at("part").at(1).get<std::uint32_t>()};
  check_part(key.part);
  key.tiles.begin = object.at("tiles").at(0).get<std::uint64_t>();
  key.tiles.end = object.at("tiles").at(1).get<std::uint64_t>();
  key.mesh = object.at("mesh");
  if (!(min(key.extent(), {1, 1, 1}) == Int3{1, 1, 1})) throw DamageError("no extent");
  return key;
}

Int3 PieceKey::extent() const {
  const json& e = mesh.at("samples").at("extent");
  return {e.at(0).get<Index>(), e.at(1).get<Index>(), e.at(2).get<Index>()};
}

double PieceDescription::isovalue() const {
  const json& value = mesh.at("isovalue");
  return value.is_string() ? std::stod(value.get<std::string>()) : value.get<double>();
}

json to_json(const PieceKey& key) {
  return {{"part", {key.part.number, key.part.count}},
          {"tiles", {key.tiles.begin, key.tiles.end}},
          {"mesh", key.mesh}};
}

std::uint64_t content_bytes(const PieceTile& tile, bool normals) {
  return mesh_bytes({tile.vertices, tile.triangles}, normals);
}

std::string to_text(const PieceDescription& header) {
  const MeshHeader& of_mesh = header.of_mesh;
  json object = to_json(header);
  object["volume"] = {to_json(of_mesh.world_lo), to_json(of_mesh.world_hi)};
  object["surface"] = nullptr;
  object["unit"] = of_mesh.unit;
  if (of_mesh.surface)
    object["surface"] = {to_json(of_mesh.surface->lo), to_json(of_mesh.surface->hi)};
  return object.dump();
}

std::optional<PieceDescription> parse_description(std::string_view text) try {
  return header_of(json::parse(text));
} catch (const json::exception&) {
  return std::nullopt;
} catch (const std::logic_error&) {  // a number in a text
  return std::nullopt;
} catch (const Error&) {
  return std::nullopt;
}

std::string difference(const json& mesh, const json& other) {
  // Other samples mostly have another region, too.
  if (mesh.value("samples", json()) != other.value("samples", json())) return "samples";
  for (const auto& [name, value] : mesh.items()) {
    const auto found = other.find(name);
    if (found != other.end() && *found == value) continue;
    if (found == other.end() || value.is_structured()) return name;
    return fmt::format("{} ({} and {})", name, value.dump(), found->dump());
  }
  return mesh == other ? "" : "options";
}

std::string part_text(Part part) { return fmt::format("{} of {}", part.number, part.count); }

}  // namespace isobrick

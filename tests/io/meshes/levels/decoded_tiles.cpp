#include "tests/io/meshes/levels/decoded_tiles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <sstream>

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr Matrix kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
/// From glTF, where y is up, to 3D Tiles, where z is.
constexpr Matrix kYUpToZUp{1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1};

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (std::size_t column = 0; column < 4; ++column)
    for (std::size_t row = 0; row < 4; ++row)
      for (std::size_t k = 0; k < 4; ++k) c[4 * column + row] += a[4 * k + row] * b[4 * column + k];
  return c;
}

/// `w`: 1 for a position, 0 for a direction.
Vec3d apply(const Matrix& m, Vec3d v, double w) {
  return {m[0] * v.x + m[4] * v.y + m[8] * v.z + w * m[12],
          m[1] * v.x + m[5] * v.y + m[9] * v.z + w * m[13],
          m[2] * v.x + m[6] * v.y + m[10] * v.z + w * m[14]};
}

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  EXPECT_TRUE(in.good()) << path;
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

Matrix matrix_of(const json& numbers) {
  Matrix m{};
  EXPECT_EQ(numbers.size(), m.size());
  for (std::size_t i = 0; i < m.size(); ++i) m[i] = numbers.at(i).get<double>();
  return m;
}

/// Members that an object may have; those that it must have end in '!'.
void expect_members(const json& object, std::initializer_list<std::string> members) {
  ASSERT_TRUE(object.is_object()) << object;
  std::set<std::string> allowed;
  for (std::string name : members) {
    const bool is_required = name.ends_with('!');
    if (is_required) name.pop_back();
    EXPECT_TRUE(!is_required || object.contains(name))
        << name << " of " << object.dump().substr(0, 200);
    allowed.insert(name);
  }
  for (const auto& [name, value] : object.items()) EXPECT_TRUE(allowed.contains(name)) << name;
}

double error_of(const json& object) {
  const json& error = object.at("geometricError");
  EXPECT_TRUE(error.is_number() && error.get<double>() >= 0) << error;
  return error.get<double>();
}

/// The box along the axes of the world around a tile's box.
MeshBounds box_of(const json& tile, const Matrix& to_world) {
  expect_members(tile.at("boundingVolume"), {"box!"});
  const json& numbers = tile.at("boundingVolume").at("box");
  EXPECT_EQ(numbers.size(), 12U);
  double n[12];
  for (std::size_t i = 0; i < 12; ++i) {
    EXPECT_TRUE(numbers.at(i).is_number());
    n[i] = numbers.at(i).get<double>();
    EXPECT_TRUE(std::isfinite(n[i]));
  }
  for (const std::size_t i : {3U, 7U, 11U}) EXPECT_GT(n[i], 0) << "a box without volume";
  for (const std::size_t i : {4U, 5U, 6U, 8U, 9U, 10U}) EXPECT_EQ(n[i], 0);
  const Vec3d centre = apply(to_world, {n[0], n[1], n[2]}, 1), half{n[3], n[7], n[11]};
  return {centre - half, centre + half};
}

/// Whether a point is in a box, but for the rounding of the way to the world.
bool holds(const MeshBounds& box, Vec3d p) {
  for (int axis = 0; axis < 3; ++axis) {
    const double slack = 4e-16 * (std::abs(box.lo[axis]) + std::abs(box.hi[axis]));
    if (!(p[axis] >= box.lo[axis] - slack && p[axis] <= box.hi[axis] + slack)) return false;
  }
  return true;
}

template <class T>
std::vector<T> elements(const json& gltf, const std::string& binary, const json& accessor_number) {
  const json& accessor = gltf.at("accessors").at(accessor_number.get<std::size_t>());
  const json& view = gltf.at("bufferViews").at(accessor.at("bufferView").get<std::size_t>());
  const std::size_t stride = view.value("byteStride", sizeof(T));
  const std::size_t begin = view.value("byteOffset", 0U) + accessor.value("byteOffset", 0U);
  const std::size_t numbers = accessor.at("type") == "VEC3" ? 3 : 1;
  const std::size_t count = accessor.at("count").get<std::size_t>() * numbers * 4 / sizeof(T);
  std::vector<T> read(count);
  EXPECT_GT(count, 0U);
  for (std::size_t i = 0; i < count; ++i) {
    if (begin + i * stride + sizeof(T) > binary.size()) {
      ADD_FAILURE() << "an accessor leaves the file";
      return {};
    }
    std::memcpy(&read[i], binary.data() + begin + i * stride, sizeof(T));
  }
  return read;
}

void decode_glb(const std::string& bytes, const Matrix& tile_to_world, DecodedTile& tile) {
  const auto word = [&](std::size_t at) {
    std::uint32_t number = 0;
    std::memcpy(&number, bytes.data() + at, 4);
    return number;
  };
  ASSERT_GT(bytes.size(), 20U);
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2U);
  EXPECT_EQ(word(8), bytes.size());
  const std::size_t json_bytes = word(12);
  tile.gltf = json::parse(bytes.substr(20, json_bytes));
  const std::string binary = bytes.substr(20 + json_bytes + 8);
  EXPECT_EQ(word(20 + json_bytes), binary.size());
  const json& node = tile.gltf.at("nodes").at(0);
  const Matrix to_world = product(tile_to_world, product(kYUpToZUp, matrix_of(node.at("matrix"))));
  const json& primitive = tile.gltf.at("meshes").at(0).at("primitives").at(0);
  tile.stored = elements<Vec3f>(tile.gltf, binary, primitive["attributes"]["POSITION"]);
  for (const Vec3f& p : tile.stored) tile.positions.push_back(apply(to_world, {p.x, p.y, p.z}, 1));
  if (primitive["attributes"].contains("NORMAL")) {
    const double scale =
        std::cbrt(apply(to_world, {1, 0, 0}, 0).x * apply(to_world, {0, 1, 0}, 0).y *
                  apply(to_world, {0, 0, 1}, 0).z);
    for (const Vec3f& n : elements<Vec3f>(tile.gltf, binary, primitive["attributes"]["NORMAL"])) {
      const Vec3d turned = apply(to_world, {n.x, n.y, n.z}, 0) * (1 / scale);
      tile.normals.push_back({static_cast<float>(turned.x), static_cast<float>(turned.y),
                              static_cast<float>(turned.z)});
    }
  }
  tile.triangles = elements<Triangle>(tile.gltf, binary, primitive["indices"]);
  for (const Triangle& t : tile.triangles)
    for (const std::uint32_t v : t) EXPECT_LT(v, tile.positions.size());
}

class Decoder {
 public:
  Decoder(const fs::path& folder, DecodedTileset& to) : folder_(folder), to_(to) {}

  /// Reads a file, whose root takes the place of a tile; null: the first one.
  void tileset(const fs::path& name, const DecodedTile* stub, const Matrix& to_world,
               std::size_t parent, int depth) {
    EXPECT_TRUE(to_.files.insert(name.string()).second) << name << " is named twice";
    to_.tilesets.insert(name.string());
    const json all = json::parse(text_of(folder_ / name));
    expect_members(all, {"asset!", "geometricError!", "root!"});
    expect_members(all.at("asset"), {"version!"});
    EXPECT_EQ(all.at("asset").at("version"), "1.1");
    EXPECT_TRUE(all.at("root").contains("refine"));
    const double error = error_of(all);
    EXPECT_GE(error, error_of(all.at("root")));
    if (stub)
      EXPECT_GE(stub->error, error_of(all.at("root")));
    else
      to_.error = error;
    tile(all.at("root"), name.parent_path(), stub, to_world, parent, depth);
  }

 private:
  void tile(const json& object, const fs::path& base, const DecodedTile* stub,
            const Matrix& parent_to_world, std::size_t parent, int depth) {
    expect_members(object, {"boundingVolume!", "geometricError!", "refine", "content", "children",
                            "transform"});
    if (object.contains("refine")) {
      EXPECT_EQ(object["refine"], "REPLACE");
    }
    const Matrix to_world = object.contains("transform")
                                ? product(parent_to_world, matrix_of(object["transform"]))
                                : parent_to_world;
    DecodedTile tile{.box = box_of(object, to_world), .error = error_of(object), .depth = depth};
    const std::size_t number = to_.tiles.size();
    tile.parent = depth == 0 ? number : parent;
    const auto within = [&](const DecodedTile& of, const char* what) {
      EXPECT_TRUE(holds(of.box, tile.box.lo) && holds(of.box, tile.box.hi))
          << "a box leaves " << what;
      EXPECT_LE(tile.error, of.error);
    };
    if (depth > 0) within(to_.tiles[parent], "its parent's");
    if (stub) within(*stub, "that of the tile that names its file");
    if (object.contains("content")) {
      expect_members(object["content"], {"uri!"});
      const fs::path uri = (base / object["content"]["uri"].get<std::string>()).lexically_normal();
      if (uri.extension() == ".json") {
        EXPECT_FALSE(object.contains("children")) << "of a tile with a tileset";
        return tileset(uri, &tile, to_world, parent, depth);
      }
      EXPECT_TRUE(to_.files.insert(uri.string()).second) << uri << " is named twice";
      tile.level = std::stoi(uri.parent_path().filename().string());
      decode_glb(text_of(folder_ / uri), to_world, tile);
      for (const Vec3d& p : tile.positions) EXPECT_TRUE(holds(tile.box, p)) << "content leaves";
    }
    to_.tiles.push_back(std::move(tile));
    if (!object.contains("children")) return;
    EXPECT_TRUE(object["children"].is_array() && !object["children"].empty());
    for (const json& child : object["children"])
      this->tile(child, base, nullptr, to_world, number, depth + 1);
  }

  const fs::path& folder_;
  DecodedTileset& to_;
};

}  // namespace

std::vector<const DecodedTile*> DecodedTileset::of_level(int level) const {
  std::vector<const DecodedTile*> found;
  for (const DecodedTile& tile : tiles)
    if (tile.level == level) found.push_back(&tile);
  return found;
}

int DecodedTileset::levels() const {
  int most = -1;
  for (const DecodedTile& tile : tiles) most = std::max(most, tile.level);
  return most + 1;
}

DecodedTileset decode_tiles(const fs::path& folder, const std::set<std::string>& other_files) {
  DecodedTileset tileset;
  Decoder(folder, tileset).tileset("tileset.json", nullptr, kIdentity, 0, 0);
  std::set<std::string> there;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) there.insert(fs::relative(entry.path(), folder).string());
  for (const std::string& name : other_files) there.erase(name);
  EXPECT_EQ(there, tileset.files);
  return tileset;
}

}  // namespace isobrick::test

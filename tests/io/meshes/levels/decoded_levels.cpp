#include "tests/io/meshes/levels/decoded_levels.h"

#include <draco/compression/decode.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>

namespace isobrick::test {
namespace {

/// Takes numbers out of bytes, from the first to the last.
class NumberReader {
 public:
  explicit NumberReader(const std::string& bytes) : bytes_(bytes) {}

  template <class T>
  T take() {
    T number{};
    if (at_ + sizeof(T) > bytes_.size()) {
      ADD_FAILURE() << "the manifest ends early";
      return number;
    }
    std::memcpy(&number, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return number;
  }
  bool is_at_end() const { return at_ == bytes_.size(); }

 private:
  const std::string& bytes_;
  std::size_t at_ = 0;
};

void decode_fragment(const std::string& bytes, DecodedFragment& fragment) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  ASSERT_TRUE(decoded.ok()) << decoded.status().error_msg_string();
  const std::unique_ptr<draco::Mesh> mesh = std::move(decoded).value();
  const draco::PointAttribute* positions =
      mesh->GetNamedAttribute(draco::GeometryAttribute::POSITION);
  ASSERT_NE(positions, nullptr);
  // What neuroglancer's decoder insists on.
  ASSERT_EQ(positions->num_components(), 3);
  ASSERT_EQ(positions->data_type(), draco::DT_INT32);
  ASSERT_EQ(positions->size(), mesh->num_points());
  for (std::uint32_t i = 0; i < mesh->num_points(); ++i) {
    std::array<std::int32_t, 3> local{};
    positions->GetMappedValue(draco::PointIndex(i), local.data());
    LatticePoint point;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ASSERT_GE(local[axis], 0);
      ASSERT_LE(local[axis], ChunkGrid::kSteps);
      point[axis] = local[axis] + std::int64_t{fragment.cell[axis]} * ChunkGrid::kSteps;
    }
    fragment.points.push_back(point);
  }
  for (std::uint32_t i = 0; i < mesh->num_faces(); ++i) {
    const draco::Mesh::Face& face = mesh->face(draco::FaceIndex(i));
    fragment.triangles.push_back({face[0].value(), face[1].value(), face[2].value()});
  }
}

}  // namespace

std::uint64_t DecodedLevel::triangles() const {
  std::uint64_t count = 0;
  for (const DecodedFragment& fragment : fragments) count += fragment.triangles.size();
  return count;
}

std::vector<LatticeTriangle> DecodedLevel::lattice_triangles() const {
  std::vector<LatticeTriangle> all;
  for (const DecodedFragment& fragment : fragments)
    for (const Triangle& t : fragment.triangles)
      all.push_back({fragment.points[t[0]], fragment.points[t[1]], fragment.points[t[2]]});
  return all;
}

double DecodedMesh::step(std::size_t level) const {
  return std::ldexp(double{edges[0]}, static_cast<int>(level)) /
         static_cast<double>(ChunkGrid::kSteps);
}

Vec3d DecodedMesh::position(std::size_t level, const LatticePoint& point) const {
  Vec3d world;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    world[axis] = double{origin[i]} + static_cast<double>(point[i]) * step(level);
  }
  return world;
}

std::string read_text(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file.good()) << path;
  return {std::istreambuf_iterator<char>(file), {}};
}

DecodedMesh decode_mesh(const std::string& manifest, const std::string& fragments) {
  NumberReader reader(manifest);
  DecodedMesh mesh;
  for (float& edge : mesh.edges) edge = reader.take<float>();
  for (float& origin : mesh.origin) origin = reader.take<float>();
  mesh.levels.resize(reader.take<std::uint32_t>());
  for (DecodedLevel& level : mesh.levels) level.scale = reader.take<float>();
  for (std::size_t i = 0; i < 3 * mesh.levels.size(); ++i) EXPECT_EQ(reader.take<float>(), 0);
  for (DecodedLevel& level : mesh.levels) level.fragments.resize(reader.take<std::uint32_t>());
  std::size_t at = 0;
  for (DecodedLevel& level : mesh.levels) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (DecodedFragment& fragment : level.fragments)
        fragment.cell[axis] = reader.take<std::uint32_t>();
    for (DecodedFragment& fragment : level.fragments) {
      const auto bytes = reader.take<std::uint32_t>();
      EXPECT_LE(at + bytes, fragments.size());
      if (bytes > 0) decode_fragment(fragments.substr(at, bytes), fragment);
      at += bytes;
    }
  }
  EXPECT_EQ(at, fragments.size());
  EXPECT_TRUE(reader.is_at_end());
  return mesh;
}

DecodedMesh decode_segment(const std::filesystem::path& folder, std::uint64_t id) {
  const std::string name = std::to_string(id);
  return decode_mesh(read_text(folder / (name + ".index")), read_text(folder / name));
}

}  // namespace isobrick::test

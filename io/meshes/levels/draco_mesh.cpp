#include "io/meshes/levels/draco_mesh.h"

#ifdef ISOBRICK_WITH_DRACO
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#endif

#include <array>
#include <memory>

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

#ifdef ISOBRICK_WITH_DRACO
namespace {

/// Of 0, the smallest, to 10, the fastest.
constexpr int kSpeed = 5;

std::unique_ptr<draco::Mesh> draco_mesh(const FragmentMesh& mesh) {
  auto result = std::make_unique<draco::Mesh>();
  result->set_num_points(static_cast<std::uint32_t>(mesh.points.size()));
  draco::GeometryAttribute positions;
  // neuroglancer's decoder takes 32 bits with a sign, or floats.
  positions.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_INT32, false,
                 3 * sizeof(std::int32_t), 0);
  const int id =
      result->AddAttribute(positions, true, static_cast<std::uint32_t>(mesh.points.size()));
  draco::PointAttribute& attribute = *result->attribute(id);
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    const std::array<std::int32_t, 3> point{mesh.points[i][0], mesh.points[i][1],
                                            mesh.points[i][2]};
    attribute.SetAttributeValue(draco::AttributeValueIndex(static_cast<std::uint32_t>(i)),
                                point.data());
  }
  result->SetNumFaces(mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    draco::Mesh::Face face;
    for (std::size_t corner = 0; corner < 3; ++corner)
      face[corner] = draco::PointIndex(mesh.triangles[i][corner]);
    result->SetFace(draco::FaceIndex(static_cast<std::uint32_t>(i)), face);
  }
  return result;
}

/// Whether all triangles were encoded; Draco's message where that failed.
bool encode_with(const draco::Mesh& mesh, draco::MeshEncoderMethod method, draco::EncoderBuffer& to,
                 std::string& failure) {
  draco::Encoder encoder;
  encoder.SetSpeedOptions(kSpeed, kSpeed);
  encoder.SetEncodingMethod(method);
  encoder.SetTrackEncodedProperties(true);
  to.Clear();
  const draco::Status status = encoder.EncodeMeshToBuffer(mesh, &to);
  failure = status.error_msg_string();
  return status.ok() && encoder.num_encoded_faces() == mesh.num_faces();
}

}  // namespace

void check_draco() {}

std::string encode_draco(const FragmentMesh& mesh) {
  if (mesh.triangles.empty()) return {};
  const std::unique_ptr<draco::Mesh> input = draco_mesh(mesh);
  draco::EncoderBuffer buffer;
  std::string failure;
  // The first way needs to take a surface apart where more than two triangles share a side; the
  // other one stores any triangles, in more bytes.
  if (!encode_with(*input, draco::MESH_EDGEBREAKER_ENCODING, buffer, failure) &&
      !encode_with(*input, draco::MESH_SEQUENTIAL_ENCODING, buffer, failure))
    throw Error(fmt::format("Draco cannot encode a part of {} triangles: {}", mesh.triangles.size(),
                            failure));
  return {buffer.data(), buffer.size()};
}

#else

void check_draco() {
  throw UsageError(
      "this isobrick cannot write neuroglancer's meshes: it was built without libdraco-dev");
}

std::string encode_draco(const FragmentMesh&) {
  check_draco();
  return {};
}

#endif

}  // namespace isobrick

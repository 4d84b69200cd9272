#include "io/meshes/levels/fragment_mesh.h"

#include <algorithm>
#include <bit>

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kLeastSlots = 64;

std::size_t hash_of(const FragmentPoint& point) {
  std::uint64_t key = point[0] | std::uint64_t{point[1]} << 16 | std::uint64_t{point[2]} << 32;
  key *= 0x9e3779b97f4a7c15;
  return static_cast<std::size_t>(key ^ key >> 29);
}

}  // namespace

void FragmentWelder::begin(std::size_t triangles, bool has_normals) {
  has_normals_ = has_normals;
  mesh_.points.clear();
  mesh_.normals.clear();
  mesh_.triangles.clear();
  mesh_.triangles.reserve(triangles);
  // A closed surface has half as many vertices as triangles.
  slots_.assign(std::bit_ceil(std::max(kLeastSlots, 2 * triangles)), 0);
}

void FragmentWelder::grow() {
  slots_.assign(2 * slots_.size(), 0);
  const std::size_t mask = slots_.size() - 1;
  for (std::size_t i = 0; i < mesh_.points.size(); ++i) {
    std::size_t at = hash_of(mesh_.points[i]) & mask;
    while (slots_[at] != 0) at = (at + 1) & mask;
    slots_[at] = static_cast<std::uint32_t>(i + 1);
  }
}

std::uint32_t FragmentWelder::number_of(const FragmentPoint& point, const Vec3f& normal) {
  const std::size_t mask = slots_.size() - 1;
  std::size_t at = hash_of(point) & mask;
  for (; slots_[at] != 0; at = (at + 1) & mask)
    if (mesh_.points[slots_[at] - 1] == point) return slots_[at] - 1;
  mesh_.points.push_back(point);
  if (has_normals_) mesh_.normals.push_back(normal);
  const auto number = static_cast<std::uint32_t>(mesh_.points.size());
  slots_[at] = number;
  if (2 * mesh_.points.size() > slots_.size()) grow();
  return number - 1;
}

void FragmentWelder::add(const std::array<FragmentPoint, 3>& corners,
                         const std::array<Vec3f, 3>& normals) {
  Triangle triangle;
  for (std::size_t i = 0; i < 3; ++i) triangle[i] = number_of(corners[i], normals[i]);
  mesh_.triangles.push_back(triangle);
}

}  // namespace isobrick

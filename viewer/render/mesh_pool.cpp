#include "viewer/render/mesh_pool.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <isobrick/error.h>
#include "core/mesh_free_list.h"

namespace isobrick::inline v0 {
namespace {

static_assert(sizeof(Vec3f) == 12 && sizeof(Triangle) == 12);

std::uint64_t bytes_of(std::uint64_t vertices, std::uint64_t triangles) {
  return vertices * 2 * sizeof(Vec3f) + triangles * sizeof(Triangle);
}

bool is_finite(Vec3f v) { return std::isfinite(v.x + v.y + v.z); }

}  // namespace

struct MeshBlock {
  MeshBlock(std::uint32_t vertex_count, std::uint32_t triangle_count)
      : vertex_room(vertex_count),
        triangle_room(triangle_count),
        free(vertex_count, triangle_count),
        positions(make_buffer(vertex_count * sizeof(Vec3f), "memory for positions")),
        normals(make_buffer(vertex_count * sizeof(Vec3f), "memory for normals")),
        triangles(make_buffer(triangle_count * sizeof(Triangle), "memory for triangles")) {}

  std::optional<MeshRange> take(std::uint32_t vertex_count, std::uint32_t triangle_count) {
    const auto range = free.take(vertex_count, triangle_count);
    if (range) used += bytes_of(vertex_count, triangle_count);
    return range;
  }
  void give_back(const MeshPlace& place) {
    free.give_back(
        {place.first_vertex, place.vertices, place.first_triangle, place.triangle_count});
    used -= bytes_of(place.vertices, place.triangle_count);
  }

  std::uint32_t vertex_room, triangle_room;
  std::uint64_t used = 0;
  MeshFreeList free;
  GlBuffer positions, normals, triangles;
};

struct MeshPool::State {
  std::uint32_t block_vertices = 0;
  std::vector<std::shared_ptr<MeshBlock>> blocks;

  /// Keeps one empty block for the next mesh; frees the others.
  void trim_but_one() {
    bool kept = false;
    std::erase_if(blocks, [&](const std::shared_ptr<MeshBlock>& block) {
      return block->used == 0 && (block->vertex_room > block_vertices || std::exchange(kept, true));
    });
  }
};

PooledMesh& PooledMesh::operator=(PooledMesh&& other) noexcept {
  std::swap(block_, other.block_);
  std::swap(place_, other.place_);
  std::swap(origin_, other.origin_);
  std::swap(has_normals_, other.has_normals_);
  return *this;
}

std::uint64_t PooledMesh::bytes() const {
  return block_ ? bytes_of(place_.vertices, place_.triangle_count) : 0;
}

void PooledMesh::reset() {
  if (block_) block_->give_back(place_);
  block_.reset();
  place_ = {};
}

MeshPool::MeshPool(std::uint32_t block_vertices) : state_(std::make_unique<State>()) {
  state_->block_vertices = block_vertices;
}
MeshPool::~MeshPool() = default;

PooledMesh MeshPool::reserve(std::uint32_t vertices, std::uint32_t triangles, bool normals,
                             Vec3d origin) {
  PooledMesh mesh;
  mesh.origin_ = origin;
  mesh.has_normals_ = normals;
  if (vertices == 0 || triangles == 0) return mesh;
  std::optional<MeshRange> range;
  for (const std::shared_ptr<MeshBlock>& block : state_->blocks)
    if ((range = block->take(vertices, triangles))) {
      mesh.block_ = block;
      break;
    }
  if (!range) {
    state_->trim_but_one();
    const std::uint32_t room = state_->block_vertices;
    mesh.block_ =
        std::make_shared<MeshBlock>(std::max(room, vertices), std::max(2 * room, triangles));
    state_->blocks.push_back(mesh.block_);
    range = mesh.block_->take(vertices, triangles);
  }
  mesh.place_ = {mesh.block_->positions.get(),
                 mesh.block_->normals.get(),
                 mesh.block_->triangles.get(),
                 range->first_vertex,
                 vertices,
                 range->first_triangle,
                 triangles};
  return mesh;
}

MeshCopy MeshPool::begin(const MeshChunk& chunk, Vec3d origin) {
  MeshCopy copy;
  const std::span<const Triangle> triangles = drawable_triangles(chunk, copy.finite_triangles_);
  constexpr std::size_t max_count = std::numeric_limits<std::int32_t>::max() / 3;
  if (chunk.positions.size() > max_count || triangles.size() > max_count)
    throw Error(
        fmt::format("a mesh of {} vertices and {} triangles is too large to be drawn as one",
                    chunk.positions.size(), triangles.size()));
  copy.mesh_ =
      reserve(static_cast<std::uint32_t>(chunk.positions.size()),
              static_cast<std::uint32_t>(triangles.size()), !chunk.normals.empty(), origin);
  if (copy.mesh_.empty()) return copy;
  const MeshPlace& place = copy.mesh_.place();
  const std::uint64_t vertex = std::uint64_t{place.first_vertex} * sizeof(Vec3f),
                      triangle = std::uint64_t{place.first_triangle} * sizeof(Triangle);
  copy.parts_.push_back({place.triangles, triangle, std::as_bytes(triangles)});
  if (copy.mesh_.has_normals())
    copy.parts_.push_back({place.normals, vertex, std::as_bytes(chunk.normals)});
  copy.parts_.push_back({place.positions, vertex, std::as_bytes(chunk.positions)});
  return copy;
}

std::uint64_t MeshCopy::bytes_left() const {
  std::uint64_t sum = 0;
  for (const Part& part : parts_) sum += part.from.size();
  return sum;
}

void MeshCopy::advance(std::uint64_t bytes) {
  if (done()) return;
  Part& part = parts_.back();
  const std::size_t now = static_cast<std::size_t>(
      std::min<std::uint64_t>(part.from.size(), std::max<std::uint64_t>(bytes, 1)));
  glNamedBufferSubData(part.buffer, static_cast<GLintptr>(part.offset),
                       static_cast<GLsizeiptr>(now), part.from.data());
  part.offset += now;
  part.from = part.from.subspan(now);
  if (part.from.empty()) parts_.pop_back();
  check_gl("a mesh");
}

PooledMesh MeshPool::add(const MeshChunk& chunk, Vec3d origin) {
  MeshCopy copy = begin(chunk, origin);
  while (!copy.done()) copy.advance(std::numeric_limits<std::uint64_t>::max());
  return copy.take();
}

bool MeshPool::shares_block(const MeshChunk& mesh) const {
  const std::uint64_t room = state_->block_vertices;
  return mesh.positions.size() <= room && mesh.triangles.size() <= 2 * room;
}

bool MeshPool::has_room(const MeshChunk& mesh) const {
  return std::any_of(state_->blocks.begin(), state_->blocks.end(),
                     [&](const std::shared_ptr<MeshBlock>& block) {
                       return block->free.has(static_cast<std::uint32_t>(mesh.positions.size()),
                                              static_cast<std::uint32_t>(mesh.triangles.size()));
                     });
}

PooledMesh MeshPool::borrow(const MeshPlace& place, Vec3d origin) {
  PooledMesh mesh;
  mesh.place_ = place;
  mesh.origin_ = origin;
  mesh.has_normals_ = true;
  return mesh;
}

void MeshPool::trim() {
  std::erase_if(state_->blocks,
                [](const std::shared_ptr<MeshBlock>& block) { return block->used == 0; });
}

void MeshPool::trim_but_one() { state_->trim_but_one(); }

std::uint64_t MeshPool::bytes() const {
  std::uint64_t sum = 0;
  for (const std::shared_ptr<MeshBlock>& block : state_->blocks) sum += block->used;
  return sum;
}

std::uint64_t MeshPool::capacity() const {
  std::uint64_t sum = 0;
  for (const std::shared_ptr<MeshBlock>& block : state_->blocks)
    sum += bytes_of(block->vertex_room, block->triangle_room);
  return sum;
}

std::span<const Triangle> drawable_triangles(const MeshChunk& mesh, std::vector<Triangle>& kept) {
  std::uint32_t largest = 0;
  for (const Triangle& t : mesh.triangles) largest = std::max({largest, t[0], t[1], t[2]});
  if (!mesh.triangles.empty() && largest >= mesh.positions.size())
    throw Error(fmt::format("a triangle names vertex {} of a mesh that has {}", largest,
                            mesh.positions.size()));
  if (!mesh.normals.empty() && mesh.normals.size() != mesh.positions.size())
    throw Error(fmt::format("a mesh of {} vertices has {} normals", mesh.positions.size(),
                            mesh.normals.size()));
  if (std::all_of(mesh.positions.begin(), mesh.positions.end(), is_finite)) return mesh.triangles;
  for (const Triangle& t : mesh.triangles)
    if (is_finite(mesh.positions[t[0]]) && is_finite(mesh.positions[t[1]]) &&
        is_finite(mesh.positions[t[2]]))
      kept.push_back(t);
  return kept;
}

}  // namespace isobrick

#include "io/meshes/stl_sink.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include <isobrick/error.h>
#include "io/meshes/append_items.h"

namespace isobrick::inline v0 {
namespace {

static_assert(std::endian::native == std::endian::little, "floats are written as they lie");

constexpr std::size_t kHeaderBytes = 80;
constexpr std::size_t kFacetBytes = 50;

/// Unit normal of a counter-clockwise triangle; in double, because the sides
/// are tiny against the coordinates' magnitude when they are multiplied.
Vec3f facet_normal(Vec3f a, Vec3f b, Vec3f c) {
  const double ux = double{b.x} - a.x, uy = double{b.y} - a.y, uz = double{b.z} - a.z;
  const double vx = double{c.x} - a.x, vy = double{c.y} - a.y, vz = double{c.z} - a.z;
  const double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
  const double length = std::sqrt(nx * nx + ny * ny + nz * nz);
  if (!(length > 0) || !std::isfinite(length)) return {0, 0, 0};
  const double scale = 1 / length;
  return {static_cast<float>(nx * scale), static_cast<float>(ny * scale),
          static_cast<float>(nz * scale)};
}

}  // namespace

StlSink::StlSink(std::string path, bool force)
    : out_(std::move(path), force, Streaming::when_complete) {}

void StlSink::begin(const MeshHeader&) {
  // Must not begin with "solid": readers take such files for text.
  std::string header = "Isobrick binary STL";
  header.resize(kHeaderBytes + sizeof(std::uint32_t), '\0');
  out_.writer().append(header);
}

void StlSink::write(const MeshChunk& chunk) {
  triangles_ += chunk.triangles.size();
  if (triangles_ > std::numeric_limits<std::uint32_t>::max())
    throw Error(
        fmt::format("'{}': the mesh has more than 4294967295 triangles, which STL cannot "
                    "count; write PLY instead or extract parts with --roi",
                    out_.path()));
  append_items<kFacetBytes>(
      out_.writer(), chunk.triangles.size(), [&](std::byte* to, std::uint64_t i) {
        const Triangle& t = chunk.triangles[i];
        const Vec3f a = chunk.positions[t[0]], b = chunk.positions[t[1]], c = chunk.positions[t[2]];
        const Vec3f facet[4] = {facet_normal(a, b, c), a, b, c};
        std::memcpy(to, facet, sizeof(facet));
        std::memset(to + sizeof(facet), 0, kFacetBytes - sizeof(facet));
      });
}

void StlSink::finish() {
  const auto count = static_cast<std::uint32_t>(triangles_);
  char bytes[sizeof(count)];
  std::memcpy(bytes, &count, sizeof(count));
  out_.writer().patch(kHeaderBytes, {bytes, sizeof(bytes)});
  out_.publish();
}

}  // namespace isobrick

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include <isobrick/error.h>
#include "core/vectors.h"
#include "io/meshes/readers/mesh_parts_reader.h"
#include "io/meshes/readers/mesh_readers.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kStart = 84, kFacet = 50, kNormal = 12;

/// Binary STL: three vertices a triangle, which nothing joins.
class StlFile final : public MeshFile {
 public:
  StlFile(std::string path, std::shared_ptr<MappedFile> file, std::uint64_t triangles)
      : path_(std::move(path)), file_(std::move(file)), triangles_(triangles) {}

  MeshFileInfo info() const override { return {.vertices = 3 * triangles_, .faces = triangles_}; }

  void bounds(Vec3d& lo, Vec3d& hi) const override {
    BoundsOf bounds(path_);
    for (std::uint64_t i = 0; i < triangles_; ++i)
      for (std::size_t k = 0; k < 3; ++k) bounds.include(to_double(corner(i, k)), 3 * i + k);
    bounds.get(lo, hi);
  }

  void read(Vec3d origin, const Take& take) const override {
    std::vector<Vec3f> positions;
    std::vector<Triangle> triangles;
    for (std::uint64_t first = 0; first < triangles_; first += kBatch) {
      const auto count = std::min<std::uint64_t>(kBatch, triangles_ - first);
      positions.clear();
      triangles.clear();
      for (std::uint64_t i = 0; i < count; ++i) {
        const auto vertex = static_cast<std::uint32_t>(3 * i);
        triangles.push_back({vertex, vertex + 1, vertex + 2});
        for (std::size_t k = 0; k < 3; ++k)
          positions.push_back(to_float(to_double(corner(first + i, k)) - origin));
      }
      MappedFile::note_read(count * kFacet);
      take({0, positions, {}, triangles}, origin);
    }
  }

 private:
  Vec3f corner(std::uint64_t triangle, std::size_t k) const {
    Vec3f v;
    std::memcpy(&v, file_->bytes().data() + kStart + triangle * kFacet + kNormal + k * sizeof(v),
                sizeof(v));
    return v;
  }

  std::string path_;
  std::shared_ptr<MappedFile> file_;
  std::uint64_t triangles_;
};

}  // namespace

std::unique_ptr<MeshFile> read_stl(const std::string& path, std::shared_ptr<MappedFile> file) {
  const auto bytes = file->bytes();
  std::uint32_t count = 0;
  if (bytes.size() >= kStart) std::memcpy(&count, bytes.data() + kStart - 4, sizeof(count));
  const std::uint64_t needed = kStart + std::uint64_t{count} * kFacet;
  // Some programs begin binary files with "solid", too: the size decides.
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (bytes.size() >= kStart && needed == bytes.size())
    return std::make_unique<StlFile>(path, std::move(file), count);
  if (text.starts_with("solid") && text.substr(0, kStart).find('\0') == text.npos)
    return read_text_stl(path, std::move(file));
  if (bytes.size() < kStart)
    throw Error(fmt::format("'{}' is damaged: {} bytes are no STL file", path, bytes.size()));
  if (bytes.size() < needed)
    throw Error(fmt::format("'{}' is damaged: {} triangles need {} bytes, and it has {}", path,
                            count, needed, bytes.size()));
  return std::make_unique<StlFile>(path, std::move(file), count);
}

}  // namespace isobrick

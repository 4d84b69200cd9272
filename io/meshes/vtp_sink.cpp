#include "io/meshes/vtp_sink.h"

#include <algorithm>
#include <span>
#include <utility>

#include "core/thread_count.h"
#include "io/meshes/vtp_parts.h"

namespace isobrick::inline v0 {
namespace {

std::string checked_pvtp_name(std::string path) {
  check_pvtp_name(path);
  return path;
}

}  // namespace

VtpSink::VtpSink(std::string path, bool force, std::size_t memory)
    : memory_(memory),
      out_(std::move(path), force, Streaming::when_complete),
      normals_(open_scratch_beside(out_.path(), memory / 3)),
      triangles_(open_scratch_beside(out_.path(), memory - memory / 3)) {}

void VtpSink::begin(const MeshHeader& header) {
  layout_.normals = header.has_normals;
  layout_.unit = header.unit;
  layout_.attributes = header.attributes;
  layout_.has_wide_numbers = header.wide;
  for (std::size_t i = 0; i < header.attributes.size(); ++i)
    attributes_.push_back(open_scratch_beside(out_.path()));
  out_.writer().append(layout_.header());
  append_length(out_.writer(), 0);
}

void VtpSink::write(const MeshChunk& chunk) {
  layout_.size.vertices += chunk.positions.size();
  layout_.size.triangles += chunk.triangles.size() + chunk.wide_triangles.size();
  out_.writer().append(std::as_bytes(chunk.positions));
  normals_.append(std::as_bytes(chunk.normals));
  if (layout_.has_wide_numbers)
    triangles_.append(std::as_bytes(chunk.wide_triangles));
  else
    triangles_.append(std::as_bytes(chunk.triangles));
  for (std::size_t i = 0; i < attributes_.size(); ++i)
    attributes_[i].append(std::as_bytes(chunk.attributes[i].values));
}

std::uint64_t VtpSink::bytes() const {
  std::uint64_t bytes = out_.writer().size() + normals_.size() + triangles_.size();
  for (const FileWriter& values : attributes_) bytes += values.size();
  return bytes;
}

void VtpSink::finish() {
  FileWriter& out = out_.writer();
  const std::string header = layout_.header();
  const std::uint64_t points = layout_.point_bytes();
  out.patch(0, header);
  out.patch(header.size(), {reinterpret_cast<const char*>(&points), sizeof(points)});
  if (layout_.normals) {
    append_length(out, points);
    out.append_file(normals_);
  }
  for (FileWriter& values : attributes_) {
    append_length(out, layout_.attribute_bytes());
    out.append_file(values);
    values.release();
  }
  append_length(out, layout_.connectivity_bytes());
  if (layout_.wide() && !layout_.has_wide_numbers)
    append_widened(out);
  else
    out.append_file(triangles_);
  append_vtp_end(out, layout_);
  normals_.release();
  triangles_.release();
  out_.publish();
}

/// Numbers that took 32 bits until the mesh was too large for Int32.
void VtpSink::append_widened(FileWriter& out) {
  constexpr std::uint64_t batch = FileWriter::kBuffer / sizeof(Triangle);
  std::vector<Triangle> triangles;
  for (std::uint64_t first = 0; first < layout_.size.triangles; first += triangles.size()) {
    triangles.resize(static_cast<std::size_t>(std::min(batch, layout_.size.triangles - first)));
    triangles_.read_back(first * sizeof(Triangle), std::as_writable_bytes(std::span(triangles)));
    append_connectivity(out, layout_, triangles);
  }
}

PvtpSink::PvtpSink(std::string path, bool force, std::uint64_t part_triangles, int threads)
    : PartedMeshSink(checked_pvtp_name(std::move(path)), force, part_triangles),
      part_triangles_(part_triangles),
      threads_(threads) {}

int PvtpSink::threads_within(int threads, std::uint64_t memory) {
  constexpr int most = 8;  // beyond, the disk bounds
  const auto affordable =
      static_cast<int>(std::min<std::uint64_t>(most, memory / 8 / memory_with(2)));
  return std::max(1, std::min(thread_count(threads), affordable));
}

std::uint64_t PvtpSink::memory_with(int threads, std::uint64_t part_triangles) {
  // A file, rows and triangles of a part are in buffers.
  constexpr std::uint64_t buffers = 4 * FileWriter::kBuffer;
  const auto others = static_cast<std::uint64_t>(threads - 1);
  return part_memory(part_triangles) + others * (part_memory(part_triangles) + buffers);
}

std::uint64_t PvtpSink::memory() const { return memory_with(threads_, part_triangles_); }

void PvtpSink::finish() {
  const MeshHeader header{.has_normals = has_normals(), .unit = unit(), .attributes = attributes()};
  const auto parts = write_parts(
      kVtpExtension, threads_, [&](FileWriter& out, const StoredMesh& mesh, const MeshPart& part) {
        write_vtp_part(out, mesh, header, part);
      });
  output().index().writer().append(pvtp_index(header, output(), parts));
  release_scratch();
  output().publish();
}

}  // namespace isobrick

#include "io/meshes/obj_sink.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/thread_count.h"

namespace isobrick::inline v0 {
namespace {

/// Items that one task turns into text.
constexpr std::size_t kBatch = 2048;
/// The longest line of a vertex: "-1.17549435e-38" is 15 characters.
constexpr std::size_t kVertexText = 2 * (3 + 3 * 16) + 2 + 3 * 16;
/// The longest line of a face: six numbers of up to 14 digits.
constexpr std::size_t kFaceText = 2 + 3 * (2 * 14 + 3);
constexpr std::size_t kBatchText = kBatch * std::max(kVertexText, kFaceText);

char* put(char* to, std::string_view text) { return std::copy(text.begin(), text.end(), to); }

template <class Number>
char* put_number(char* to, Number number) {
  return std::to_chars(to, to + 32, number).ptr;
}

char* put_numbers(char* to, Vec3f v) {
  for (int axis = 0; axis < 3; ++axis) {
    *to++ = ' ';
    to = put_number(to, v[axis]);
  }
  return to;
}

/// `colour`: behind the position, from 0 to 1; null: none.
char* put_vector(char* to, std::string_view keyword, Vec3f v,
                 const VertexColour* colour = nullptr) {
  to = put_numbers(put(to, keyword), v);
  if (colour) {
    const auto part = [&](std::size_t i) { return static_cast<float>((*colour)[i]) / 255; };
    to = put_numbers(to, {part(0), part(1), part(2)});
  }
  *to++ = '\n';
  return to;
}

template <class AnyTriangle>
char* put_face(char* to, const AnyTriangle& triangle, bool normals) {
  *to++ = 'f';
  for (const std::uint64_t vertex : triangle) {
    *to++ = ' ';
    char* const number = to;
    to = put_number(to, vertex + 1);
    if (!normals) continue;
    const std::size_t digits = static_cast<std::size_t>(to - number);
    to = put(to, "//");
    to = std::copy(number, number + digits, to);
  }
  *to++ = '\n';
  return to;
}

/// Appends the text of items [0, count): put_item(to, i) writes one and returns its end.
template <class PutItem>
void append_text(FileWriter& out, tbb::task_arena& arena, std::size_t count,
                 const PutItem& put_item) {
  const std::size_t batches = (count + kBatch - 1) / kBatch;
  const std::size_t at_once = std::min(batches, static_cast<std::size_t>(arena.max_concurrency()));
  const auto text = std::make_unique_for_overwrite<char[]>(at_once * kBatchText);
  std::vector<std::size_t> sizes(at_once);
  for (std::size_t first = 0; first < batches; first += at_once) {
    const std::size_t now = std::min(at_once, batches - first);
    arena.execute([&] {
      tbb::parallel_for(std::size_t{0}, now, [&](std::size_t i) {
        char* const begin = text.get() + i * kBatchText;
        char* to = begin;
        const std::size_t from = (first + i) * kBatch;
        for (std::size_t k = from; k < std::min(from + kBatch, count); ++k) to = put_item(to, k);
        sizes[i] = static_cast<std::size_t>(to - begin);
      });
    });
    for (std::size_t i = 0; i < now; ++i)
      out.append(std::string_view(text.get() + i * kBatchText, sizes[i]));
  }
}

}  // namespace

ObjSink::ObjSink(std::string path, bool force, int threads, MeshLabelling labelling)
    : out_(std::move(path), force),
      faces_(open_scratch_beside(out_.path())),
      arena_(thread_count(threads)),
      labelling_(std::move(labelling)) {}

std::uint64_t ObjSink::memory_with(int threads) {
  return static_cast<std::uint64_t>(thread_count(threads)) * kBatchText;
}

void ObjSink::begin(const MeshHeader& header) {
  has_normals_ = header.has_normals;
  out_.writer().append("# Isobrick\n");
  if (!header.unit.empty()) out_.writer().append("# unit " + header.unit + "\n");
  if (!labelling_.name.empty()) out_.writer().append("o " + labelling_.line() + "\n");
  has_colours_ = header.has_colours || labelling_.colour;
}

void ObjSink::write(const MeshChunk& given) {
  const MeshChunk chunk = labelling_.coloured(given, colours_);
  const bool normals = !chunk.normals.empty();
  append_text(out_.writer(), arena_, chunk.positions.size(), [&](char* to, std::size_t i) {
    to = put_vector(to, "v", chunk.positions[i], has_colours_ ? &chunk.colours[i] : nullptr);
    return normals ? put_vector(to, "vn", chunk.normals[i]) : to;
  });
  const auto append_faces = [&](auto triangles) {
    append_text(faces_, arena_, triangles.size(),
                [&](char* to, std::size_t i) { return put_face(to, triangles[i], has_normals_); });
  };
  append_faces(chunk.triangles);
  append_faces(chunk.wide_triangles);
}

void ObjSink::finish() {
  out_.writer().append_file(faces_);
  faces_.release();
  out_.publish();
}

}  // namespace isobrick

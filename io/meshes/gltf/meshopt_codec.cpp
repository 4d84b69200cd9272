#include "io/meshes/gltf/meshopt_codec.h"

#ifdef ISOBRICK_WITH_MESHOPT
#include <meshoptimizer.h>
#endif

#include <isobrick/error.h>

namespace isobrick::inline v0 {

#ifdef ISOBRICK_WITH_MESHOPT
namespace {

/// The versions of the encodings that the extension names. Those that the library would take
/// differ among its own versions.
void choose_versions() {
  [[maybe_unused]] static const bool once = [] {
    meshopt_encodeVertexVersion(0);
    meshopt_encodeIndexVersion(1);
    return true;
  }();
}

template <class Encode>
EncodedBytes encode(std::size_t bound, const Encode& encode_to) {
  choose_versions();
  EncodedBytes encoded{std::make_unique_for_overwrite<std::byte[]>(bound)};
  encoded.size = encode_to(reinterpret_cast<unsigned char*>(encoded.bytes.get()));
  return encoded;
}

/// Whether the filter is one of `view`, which it undoes.
bool undo_filter(const MeshoptView& view, std::byte* bytes) {
  if (view.filter == "NONE") return true;
  if (view.filter == "OCTAHEDRAL" && (view.stride == 4 || view.stride == 8))
    meshopt_decodeFilterOct(bytes, view.count, view.stride);
  else if (view.filter == "QUATERNION" && view.stride == 8)
    meshopt_decodeFilterQuat(bytes, view.count, view.stride);
  else if (view.filter == "EXPONENTIAL")
    meshopt_decodeFilterExp(bytes, view.count, view.stride);
  else
    return false;
  return true;
}

}  // namespace

void check_meshopt() {}

std::size_t max_encoded_rows(std::size_t rows, std::size_t stride) {
  return meshopt_encodeVertexBufferBound(rows, stride);
}

std::size_t max_encoded_triangles(std::size_t triangles, std::size_t vertices) {
  return meshopt_encodeIndexBufferBound(3 * triangles, vertices);
}

EncodedBytes encode_rows(std::span<const std::byte> rows, std::size_t stride) {
  const std::size_t count = rows.size() / stride, bound = max_encoded_rows(count, stride);
  return encode(bound, [&](unsigned char* to) {
    return meshopt_encodeVertexBuffer(to, bound, rows.data(), count, stride);
  });
}

EncodedBytes encode_triangles(std::span<const Triangle> triangles, std::size_t vertices) {
  const std::size_t bound = max_encoded_triangles(triangles.size(), vertices);
  const auto* indices = reinterpret_cast<const unsigned int*>(triangles.data());
  return encode(bound, [&](unsigned char* to) {
    return meshopt_encodeIndexBuffer(to, bound, indices, 3 * triangles.size());
  });
}

bool decode_meshopt(const MeshoptView& view, std::span<const std::byte> encoded, std::byte* to) {
  const auto* from = reinterpret_cast<const unsigned char*>(encoded.data());
  const std::size_t stride = view.stride;
  if (view.mode == "ATTRIBUTES")
    return stride > 0 && stride <= 256 && stride % 4 == 0 &&
           meshopt_decodeVertexBuffer(to, view.count, stride, from, encoded.size()) == 0 &&
           undo_filter(view, to);
  if (stride != 2 && stride != 4) return false;
  if (view.mode == "TRIANGLES")
    return view.count % 3 == 0 &&
           meshopt_decodeIndexBuffer(to, view.count, stride, from, encoded.size()) == 0;
  return view.mode == "INDICES" &&
         meshopt_decodeIndexSequence(to, view.count, stride, from, encoded.size()) == 0;
}

#else

void check_meshopt() {
  throw UsageError(
      "this isobrick knows no compressed GLB: it was built without libmeshoptimizer-dev");
}

std::size_t max_encoded_rows(std::size_t, std::size_t) { return 0; }

std::size_t max_encoded_triangles(std::size_t, std::size_t) { return 0; }

EncodedBytes encode_rows(std::span<const std::byte>, std::size_t) {
  check_meshopt();
  return {};
}

EncodedBytes encode_triangles(std::span<const Triangle>, std::size_t) {
  check_meshopt();
  return {};
}

bool decode_meshopt(const MeshoptView&, std::span<const std::byte>, std::byte*) {
  check_meshopt();
  return false;
}

#endif

}  // namespace isobrick

#include "io/meshes/readers/gltf_buffers.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string_view>

#include <isobrick/error.h>
#include "io/bytes/base64_stream.h"
#include "io/bytes/mapped_file.h"
#include "io/meshes/readers/memory_stream.h"
#include "io/meshes/readers/scratch_rows.h"

namespace isobrick::inline v0 {
namespace {

/// "a%20b" → "a b".
std::string percent_decoded(std::string_view text) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size() && digit(text[i + 1]) >= 0 &&
        digit(text[i + 2]) >= 0) {
      decoded += static_cast<char>(16 * digit(text[i + 1]) + digit(text[i + 2]));
      i += 2;
    } else {
      decoded += text[i];
    }
  }
  return decoded;
}

/// What base64 text stands for, in a file without a name.
std::shared_ptr<MappedFile> decode_base64(const std::string& path, std::string_view text) {
  const auto stream = make_base64_stream(make_memory_stream(path, std::as_bytes(std::span(text))));
  ScratchBytes bytes;
  std::vector<std::byte> piece(std::size_t{1} << 16);
  while (const std::size_t count = stream->read(piece.data(), piece.size()))
    bytes.append({piece.data(), count});
  return bytes.map();
}

}  // namespace

void fail_gltf(const std::string& path, const std::string& what) {
  throw Error(fmt::format("'{}' is no glTF file that can be drawn: {}", path, what));
}

std::span<const std::byte> GltfBuffers::get(const nlohmann::json& buffer, std::uint64_t number) {
  if (!buffer.contains("uri")) {
    if (number != 0 || binary_.data() == nullptr)
      fail_gltf(path_, fmt::format("buffer {} is nowhere", number));
    return binary_;
  }
  if (const auto known = opened_.find(number); known != opened_.end()) return known->second;
  return opened_[number] = open(buffer.at("uri").get_ref<const std::string&>());
}

std::span<const std::byte> GltfBuffers::decode(std::uint64_t number, const MeshoptView& view,
                                               std::span<const std::byte> encoded) {
  check_meshopt();
  if (const auto known = decoded_.find(number); known != decoded_.end()) return known->second;
  // No encoding is shorter, so a damaged number takes no memory.
  constexpr std::size_t max_ratio = 64;
  const auto fail = [&] { fail_gltf(path_, fmt::format("compressed view {} is damaged", number)); };
  if (view.stride == 0 || view.stride > 256 || view.count / max_ratio > encoded.size() ||
      view.count * view.stride / max_ratio > encoded.size())
    fail();
  const std::size_t size = view.count * view.stride;
  const auto bytes = std::make_unique_for_overwrite<std::byte[]>(size);
  if (!decode_meshopt(view, encoded, bytes.get())) fail();
  ScratchBytes scratch;
  scratch.append({bytes.get(), size});
  const std::shared_ptr<MappedFile> file = scratch.map();
  files_.push_back(file);
  return decoded_[number] = file->bytes();
}

std::span<const std::byte> GltfBuffers::open(const std::string& uri) {
  std::shared_ptr<MappedFile> file;
  if (uri.starts_with("data:")) {
    constexpr std::string_view mark = ";base64,";
    const std::size_t comma = uri.find(',');
    const std::size_t at = uri.substr(0, comma == uri.npos ? 0 : comma + 1).find(mark);
    if (at == uri.npos) fail_gltf(path_, "a buffer in its text is not base64");
    file = decode_base64(path_, std::string_view(uri).substr(at + mark.size()));
  } else {
    const std::filesystem::path name = percent_decoded(uri);
    bool leads_away = name.is_absolute() || uri.find("://") != uri.npos;
    for (const auto& part : name) leads_away |= part == "..";
    if (leads_away) fail_gltf(path_, fmt::format("its buffer '{}' is not below its folder", uri));
    file =
        std::make_shared<MappedFile>((std::filesystem::path(path_).parent_path() / name).string());
  }
  files_.push_back(file);
  return file->bytes();
}

}  // namespace isobrick

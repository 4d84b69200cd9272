#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "io/meshes/gltf/meshopt_codec.h"

namespace isobrick::inline v0 {

[[noreturn]] void fail_gltf(const std::string& path, const std::string& what);

/// The buffers of a glTF scene: within a GLB, in files beside the scene, or in its text.
class GltfBuffers {
 public:
  explicit GltfBuffers(std::string path) : path_(std::move(path)) {}

  /// The chunk of a GLB that is buffer 0.
  void set_binary(std::span<const std::byte> binary) { binary_ = binary; }
  /// The bytes of the scene's buffer `number`. Throws Error for one that is not there, lies
  /// elsewhere than below the scene's folder, or is no base64.
  std::span<const std::byte> get(const nlohmann::json& buffer, std::uint64_t number);
  /// What view `number` of the scene decodes to, of count x stride bytes, in a file without a name.
  /// Throws Error for what is damaged, and as check_meshopt() does.
  std::span<const std::byte> decode(std::uint64_t number, const MeshoptView& view,
                                    std::span<const std::byte> encoded);
  /// What the bytes lie in.
  const std::vector<std::shared_ptr<const void>>& files() const { return files_; }

 private:
  std::span<const std::byte> open(const std::string& uri);

  std::string path_;
  std::span<const std::byte> binary_;
  std::map<std::uint64_t, std::span<const std::byte>> opened_, decoded_;
  std::vector<std::shared_ptr<const void>> files_;
};

}  // namespace isobrick

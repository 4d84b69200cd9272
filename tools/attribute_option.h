#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/attributes.h>
#include <isobrick/open_volume.h>
#include "tools/input.h"

namespace isobrick::tools {

/// A vertex attribute that is sampled from another volume: --attribute NAME=STORE[:channel].
struct AttributeRequest {
  std::string name;
  std::string path;
  Selection selection;
};

/// What follows the last ':' is a channel where that is digits, no input has the whole name, and
/// what is before it is no scheme with a host alone, whose number is a port. Throws UsageError for
/// a text without '=' or a name or path that is empty.
AttributeRequest parse_attribute(const std::string& text);

/// --attribute.
void add_attributes(CLI::App* app, std::vector<AttributeRequest>& attributes);

/// The volumes of all attributes of a mesh.
class AttributeVolumes {
 public:
  /// Opens them, by way of the cache of `input` where they are no stores. `unit` is that of the
  /// volume that the mesh is of, and of those without one.
  AttributeVolumes(const std::vector<AttributeRequest>& requests, const InputArguments& input,
                   std::uint64_t memory, int threads, const std::string& unit, Console& console);

  bool empty() const { return attributes_.empty(); }
  /// How the meshes of so many surfaces are sampled that are made with a budget of `memory`.
  SampleOptions options(std::uint64_t memory, std::size_t surfaces) const;
  /// What one of them holds.
  std::uint64_t memory(const SampleOptions& options) const;
  const std::vector<SampledAttribute>& attributes() const { return attributes_; }

 private:
  std::vector<OpenedVolume> volumes_;
  std::vector<SampledAttribute> attributes_;
  std::string unit_;
  int threads_;
};

std::vector<std::string> names_of(const std::vector<AttributeRequest>& requests);

/// Inputs that no output may replace.
std::vector<std::filesystem::path> paths_of(const std::vector<AttributeRequest>& requests);

}  // namespace isobrick::tools

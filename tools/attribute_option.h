#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
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

/// Colours of an attribute: --colour-by NAME[=LOW:HIGH] and --colour-map.
struct ColourRequest {
  std::string attribute;  ///< empty: none
  std::optional<std::pair<double, double>> range;
  std::optional<ColourMap> map;
};

/// "NAME" or "NAME=LOW:HIGH". Throws UsageError for any other text.
ColourRequest parse_colour_by(const std::string& text);

/// --attribute, --colour-by and --colour-map.
void add_attributes(CLI::App* app, std::vector<AttributeRequest>& attributes,
                    ColourRequest& colours);

/// Throws UsageError for names that no file could hold, and for colours of none of the attributes.
void check_attributes(const std::vector<AttributeRequest>& attributes,
                      const ColourRequest& colours);

/// What gives a mesh its attributes and its colours on the way to its file.
struct AttributeSinks {
  std::unique_ptr<ColourSink> colours;        ///< null without any
  std::unique_ptr<AttributeSink> attributes;  ///< before them; null without any
};

/// The volumes of all attributes of a mesh.
class AttributeVolumes {
 public:
  /// Opens them, by way of the cache of `input` where they are no stores. `unit` is that of the
  /// volume that the mesh is of, and of those without one.
  /// Colours reach over the samples of level 0 where they have no range.
  AttributeVolumes(const std::vector<AttributeRequest>& requests, const ColourRequest& colours,
                   const InputArguments& input, std::uint64_t memory, int threads,
                   const std::string& unit, Console& console);

  bool empty() const { return attributes_.empty(); }
  /// How the meshes of so many surfaces are sampled that are made with a budget of `memory`.
  SampleOptions options(std::uint64_t memory, std::size_t surfaces) const;
  /// What one of them holds.
  std::uint64_t memory(const SampleOptions& options) const;
  /// What comes before `sink`, which must outlive it; `options`: options().
  AttributeSinks open(MeshSink& sink, const SampleOptions& options) const;

 private:
  void choose_colours(const ColourRequest& request, Console& console);

  std::vector<OpenedVolume> volumes_;
  std::vector<SampledAttribute> attributes_;
  std::optional<AttributeColours> colours_;
  std::string unit_;
  int threads_;
};

std::vector<std::string> names_of(const std::vector<AttributeRequest>& requests);

/// Inputs that no output may replace.
std::vector<std::filesystem::path> paths_of(const std::vector<AttributeRequest>& requests);

}  // namespace isobrick::tools

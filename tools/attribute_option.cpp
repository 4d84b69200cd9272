#include "tools/attribute_option.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include <isobrick/error.h>
#include <isobrick/mesh_sinks.h>
#include "tools/parse.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;

/// Whether a ':' behind this begins a port: "https://host".
bool is_scheme_and_host(std::string_view text) {
  const std::size_t scheme = text.find("://");
  return scheme != text.npos && text.find('/', scheme + 3) == text.npos;
}

bool exists(const std::string& path) {
  std::error_code failure;
  return fs::exists(path, failure);
}

}  // namespace

AttributeRequest parse_attribute(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == text.npos || equals == 0 || equals + 1 == text.size())
    throw UsageError(fmt::format(
        "'{}' is no attribute; it is NAME=STORE, such as pressure=p.zarr, or NAME=STORE:CHANNEL",
        text));
  AttributeRequest request{.name = text.substr(0, equals), .path = text.substr(equals + 1)};
  check_attribute_names({&request.name, 1});
  const std::size_t colon = request.path.rfind(':');
  if (colon == std::string::npos || colon == 0) return request;
  const std::string channel = request.path.substr(colon + 1), path = request.path.substr(0, colon);
  if (channel.empty() || channel.find_first_not_of("0123456789") != std::string::npos ||
      is_scheme_and_host(path) || exists(request.path))
    return request;
  request.selection.channel = parse_int(channel, 0, 65535);
  request.path = path;
  return request;
}

void add_attributes(CLI::App* app, std::vector<AttributeRequest>& attributes) {
  add_repeated(
      app,
      {"--attribute", "NAME=STORE[:CHANNEL]",
       "Sample another volume at the vertices, as a vertex attribute of PLY, VTP, PVTP or "
       "GLB; may be repeated"},
      [&attributes](const std::string& text) { attributes.push_back(parse_attribute(text)); });
}

AttributeVolumes::AttributeVolumes(const std::vector<AttributeRequest>& requests,
                                   const InputArguments& input, std::uint64_t memory, int threads,
                                   const std::string& unit, Console& console)
    : unit_(unit), threads_(threads) {
  for (const AttributeRequest& request : requests) {
    const InputArguments other{
        .path = request.path, .volume = {.selection = request.selection}, .cache = input.cache};
    volumes_.push_back(open_input(other, memory, threads, console, false));
  }
  for (std::size_t i = 0; i < requests.size(); ++i)
    attributes_.push_back({requests[i].name, &volumes_[i].store()});
}

SampleOptions AttributeVolumes::options(std::uint64_t memory, std::size_t surfaces) const {
  const SampleOptions usual;
  return {.volume_unit = unit_,
          .threads = threads_,
          .memory = std::min(usual.memory, memory / 8 / std::max<std::size_t>(surfaces, 1))};
}

std::uint64_t AttributeVolumes::memory(const SampleOptions& options) const {
  if (empty()) return 0;
  FunctionSink nowhere([](const MeshChunk&) {});
  return AttributeSink(nowhere, attributes_, options).memory();
}

std::vector<std::string> names_of(const std::vector<AttributeRequest>& requests) {
  std::vector<std::string> names;
  for (const AttributeRequest& request : requests) names.push_back(request.name);
  return names;
}

std::vector<fs::path> paths_of(const std::vector<AttributeRequest>& requests) {
  std::vector<fs::path> paths;
  for (const AttributeRequest& request : requests) paths.emplace_back(request.path);
  return paths;
}

}  // namespace isobrick::tools

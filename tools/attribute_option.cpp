#include "tools/attribute_option.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <tuple>

#include <isobrick/error.h>
#include <isobrick/mesh_sinks.h>
#include "tools/parse.h"
#include "tools/value_range.h"

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

ColourRequest parse_colour_by(const std::string& text) {
  ColourRequest request{.attribute = text.substr(0, text.find('='))};
  if (request.attribute.size() == text.size()) return request;
  const std::string range = text.substr(request.attribute.size() + 1);
  const std::size_t colon = range.find(':');
  if (request.attribute.empty() || colon == range.npos)
    throw UsageError(fmt::format(
        "'{}' is no attribute to colour by; it is NAME or NAME=LOW:HIGH, such as pressure=0:2.5",
        text));
  request.range = {parse_number(range.substr(0, colon)), parse_number(range.substr(colon + 1))};
  if (request.range->first == request.range->second)
    throw UsageError(fmt::format("'{}': colours need two values that differ", text));
  return request;
}

ColourMap parse_colour_map(const std::string& text) {
  if (text == "viridis") return ColourMap::viridis;
  if (text == "coolwarm") return ColourMap::coolwarm;
  if (text == "grey") return ColourMap::grey;
  throw UsageError(
      fmt::format("'{}' is no scale of colours; it is viridis, coolwarm or grey", text));
}

void check_attributes(const std::vector<AttributeRequest>& attributes,
                      const ColourRequest& colours) {
  const std::vector<std::string> names = names_of(attributes);
  check_attribute_names(names);
  if (colours.attribute.empty()) {
    if (colours.map) throw UsageError("--colour-map is of --colour-by NAME: add it");
    return;
  }
  if (std::find(names.begin(), names.end(), colours.attribute) == names.end())
    throw UsageError(
        fmt::format("--colour-by: there is no attribute '{}': add --attribute {}=STORE",
                    colours.attribute, colours.attribute));
}

void add_attributes(CLI::App* app, std::vector<AttributeRequest>& attributes,
                    ColourRequest& colours) {
  add_repeated(
      app,
      {"--attribute", "NAME=STORE[:CHANNEL]",
       "Sample another volume at the vertices, as a vertex attribute of PLY, VTP, PVTP or "
       "GLB; may be repeated"},
      [&attributes](const std::string& text) { attributes.push_back(parse_attribute(text)); });
  add_text(app,
           {"--colour-by", "NAME[=LOW:HIGH]",
            "Colour the vertices of a GLB or PLY by an attribute, from LOW to HIGH; without them "
            "over all samples of its volume"},
           [&colours](const std::string& text) {
             const std::optional<ColourMap> map = colours.map;
             colours = parse_colour_by(text);
             colours.map = map;
           });
  add_text(app, {"--colour-map", "viridis|coolwarm|grey", "Scale of colours", "viridis"},
           [&colours](const std::string& text) { colours.map = parse_colour_map(text); });
}

AttributeVolumes::AttributeVolumes(const std::vector<AttributeRequest>& requests,
                                   const ColourRequest& colours, const InputArguments& input,
                                   std::uint64_t memory, int threads, const std::string& unit,
                                   Console& console)
    : unit_(unit), threads_(threads) {
  for (const AttributeRequest& request : requests) {
    const InputArguments other{
        .path = request.path, .volume = {.selection = request.selection}, .cache = input.cache};
    volumes_.push_back(open_input(other, memory, threads, console, false));
  }
  for (std::size_t i = 0; i < requests.size(); ++i)
    attributes_.push_back({requests[i].name, &volumes_[i].store()});
  choose_colours(colours, console);
}

void AttributeVolumes::choose_colours(const ColourRequest& request, Console& console) {
  if (request.attribute.empty()) return;
  colours_ = {.attribute = request.attribute, .map = request.map.value_or(ColourMap::viridis)};
  if (request.range) {
    std::tie(colours_->low, colours_->high) = *request.range;
    return;
  }
  const auto of_name = std::find_if(
      attributes_.begin(), attributes_.end(),
      [&](const SampledAttribute& attribute) { return attribute.name == request.attribute; });
  const StoreReader& store = *of_name->store;
  const ValueRange<double> range =
      store.has_ranges(0) ? value_range(store, 0) : ValueRange<double>{};
  if (!(range.lo < range.hi) || !std::isfinite(range.lo) || !std::isfinite(range.hi))
    throw UsageError(
        fmt::format("--colour-by {0}: the range of its volume is not known, or is a single value: "
                    "add it, as in {0}=0:1",
                    request.attribute));
  colours_->low = range.lo;
  colours_->high = range.hi;
  console.note(
      fmt::format("colours of {} reach from {} to {}", request.attribute, range.lo, range.hi));
}

AttributeSinks AttributeVolumes::open(MeshSink& sink, const SampleOptions& options) const {
  AttributeSinks sinks;
  if (empty()) return sinks;
  MeshSink* next = &sink;
  if (colours_) {
    sinks.colours = std::make_unique<ColourSink>(sink, *colours_);
    next = sinks.colours.get();
  }
  sinks.attributes = std::make_unique<AttributeSink>(*next, attributes_, options);
  return sinks;
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

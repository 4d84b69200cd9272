#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include <isobrick/attributes.h>
#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kMaxName = 64;
/// A row of a GLB has 252 bytes at most.
constexpr std::size_t kMaxAttributes = 32;
/// What vertices of meshes have by themselves, in small letters.
constexpr std::array<std::string_view, 15> kReserved{
    "x",    "y",     "z",    "nx",     "ny",      "nz",       "red",   "green",
    "blue", "alpha", "unit", "points", "normals", "position", "normal"};

std::string lowered(std::string_view name) {
  std::string small(name);
  for (char& c : small)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return small;
}

bool is_identifier(std::string_view name) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const auto is_letter = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
  };
  return !name.empty() && name.size() <= kMaxName && !is_digit(name.front()) &&
         std::all_of(name.begin(), name.end(), [&](char c) { return is_digit(c) || is_letter(c); });
}

}  // namespace

void check_attribute_names(std::span<const std::string> names) {
  if (names.size() > kMaxAttributes)
    throw UsageError(fmt::format("a mesh takes {} attributes at most", kMaxAttributes));
  std::vector<std::string> seen;
  for (const std::string& name : names) {
    if (!is_identifier(name))
      throw UsageError(
          fmt::format("'{}' is no name of an attribute: it takes ASCII letters, digits and "
                      "underscores, no digit first, {} characters at most",
                      name, kMaxName));
    const std::string small = lowered(name);
    if (std::find(kReserved.begin(), kReserved.end(), small) != kReserved.end())
      throw UsageError(fmt::format(
          "'{}' is no name of an attribute: vertices have one of that name already", name));
    if (std::find(seen.begin(), seen.end(), small) != seen.end())
      throw UsageError(fmt::format(
          "the attribute '{}' is given twice (small letters and capitals are the same)", name));
    seen.push_back(small);
  }
}

struct AttributeSink::Impl {
  MeshSink& sink;
  std::vector<SampledAttribute> attributes;
  SampleOptions options;
  std::vector<VolumeSampler> samplers;
  std::vector<std::vector<float>> values;
  std::vector<VertexAttribute> views;

  void make_samplers(const std::string& mesh_unit);
};

void AttributeSink::Impl::make_samplers(const std::string& mesh_unit) {
  SampleOptions own = options;
  if (!mesh_unit.empty()) own.unit = mesh_unit;
  own.memory = options.memory / std::max<std::size_t>(attributes.size(), 1);
  samplers.clear();
  for (const SampledAttribute& attribute : attributes) samplers.emplace_back(*attribute.store, own);
}

AttributeSink::AttributeSink(MeshSink& sink, std::vector<SampledAttribute> attributes,
                             const SampleOptions& options)
    : impl_(std::make_unique<Impl>(Impl{sink, std::move(attributes), options, {}, {}, {}})) {
  std::vector<std::string> names;
  for (const SampledAttribute& attribute : impl_->attributes) names.push_back(attribute.name);
  check_attribute_names(names);
  // Now, so that memory() is known before the mesh begins.
  impl_->make_samplers({});
  impl_->values.resize(impl_->attributes.size());
}

AttributeSink::~AttributeSink() = default;

Indexing AttributeSink::indexing() const { return impl_->sink.indexing(); }

bool AttributeSink::takes_wide() const { return impl_->sink.takes_wide(); }

void AttributeSink::begin(const MeshHeader& header) {
  Impl& impl = *impl_;
  impl.make_samplers(header.unit);
  MeshHeader with_names = header;
  for (const SampledAttribute& attribute : impl.attributes)
    with_names.attributes.push_back(attribute.name);
  check_attribute_names(with_names.attributes);
  impl.sink.begin(with_names);
}

void AttributeSink::write(const MeshChunk& chunk) {
  Impl& impl = *impl_;
  impl.views.assign(chunk.attributes.begin(), chunk.attributes.end());
  for (std::size_t i = 0; i < impl.attributes.size(); ++i) {
    impl.values[i].resize(chunk.positions.size());
    impl.samplers[i].sample(chunk.positions, impl.values[i]);
    impl.views.push_back({impl.attributes[i].name, impl.values[i]});
  }
  MeshChunk with_values = chunk;
  with_values.attributes = impl.views;
  impl.sink.write(with_values);
}

void AttributeSink::finish() {
  impl_->samplers.clear();
  impl_->sink.finish();
}

std::uint64_t AttributeSink::bytes() const { return impl_->sink.bytes(); }

std::uint64_t AttributeSink::memory() const {
  std::uint64_t bytes = impl_->sink.memory();
  for (const VolumeSampler& sampler : impl_->samplers) bytes += sampler.memory();
  return bytes;
}

}  // namespace isobrick

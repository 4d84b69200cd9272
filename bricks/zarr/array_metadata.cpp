#include "bricks/zarr/array_metadata.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <limits>

#include <isobrick/error.h>
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/shard_index.h"
#include "packed/packed_format.h"

namespace isobrick::inline v0 {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxDimensions = 8;
constexpr std::size_t kMaxCodecs = 8;
/// A name with a prefix of its own, as Zarr 3 wants for codecs that its registry lacks.
constexpr const char* kPackedName = "isobrick.packed";

Json named(const char* name, Json configuration) {
  return {{"name", name}, {"configuration", std::move(configuration)}};
}

Json codec_list(const CodecChain& chain) {
  Json list = Json::array();
  if (chain.packed)
    list.push_back(named(kPackedName, {{"version", packed::kVersion}}));
  else
    list.push_back(named("bytes", {{"endian", chain.big_endian ? "big" : "little"}}));
  for (const ByteCodec step : chain.steps) {
    if (step == ByteCodec::zstd)
      list.push_back(named("zstd", {{"level", chain.zstd_level}, {"checksum", false}}));
    else
      list.push_back({{"name", name_of(step)}});
  }
  return list;
}

Json fill_value_json(ScalarType type, const SampleValue& fill) {
  if (!is_floating(type)) {
    if (const auto value = fill.as_signed()) return *value;
    if (const auto value = fill.as_unsigned()) return *value;
    throw Error(fmt::format("fill value {} is no {}", fill.text(), zarr_name(type)));
  }
  const double value = fill;
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value > 0 ? "Infinity" : "-Infinity";
  return value;
}

double bits_to_double(const JsonReader& json, ScalarType type, const std::string& text) {
  const std::size_t digits = 2 * size_of(type);
  if (text.size() != digits + 2 ||
      text.find_first_not_of("0123456789abcdefABCDEF", 2) != std::string::npos)
    json.damaged(fmt::format("'{}' is no {}", text, zarr_name(type)));
  const std::uint64_t bits = std::strtoull(text.c_str() + 2, nullptr, 16);
  if (type == ScalarType::f64) return std::bit_cast<double>(bits);
  if (!is_floating(type)) return static_cast<double>(bits);
  return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
}

SampleValue parse_integer(const JsonReader& json) {
  const nlohmann::json& raw = json.raw();
  if (raw.is_number_unsigned()) return raw.get<std::uint64_t>();
  if (raw.is_number_integer()) return raw.get<std::int64_t>();
  const double value = json.number();
  if (std::trunc(value) != value) json.damaged(fmt::format("{} is no integer", value));
  return value;
}

double parse_floating_fill_value(const JsonReader& json, ScalarType type) {
  if (json.raw().is_string()) {
    const std::string text = json.string();
    constexpr double infinity = std::numeric_limits<double>::infinity();
    if (text == "NaN") return std::numeric_limits<double>::quiet_NaN();
    if (text == "Infinity") return infinity;
    if (text == "-Infinity") return -infinity;
    if (text.starts_with("0x")) return bits_to_double(json, type, text);
    json.damaged(fmt::format("'{}' is no {}", text, zarr_name(type)));
  }
  const double value = json.number();
  if (type == ScalarType::f64) return value;
  // Written as a decimal number; the sample is the nearest float.
  if (std::abs(value) > static_cast<double>(std::numeric_limits<float>::max()))
    json.damaged(fmt::format("{} is no float32", value));
  return static_cast<double>(static_cast<float>(value));
}

SampleValue parse_fill_value(const JsonReader& json, ScalarType type) {
  if (is_floating(type)) return parse_floating_fill_value(json, type);
  const SampleValue value = parse_integer(json);
  if (!is_sample(value, type))
    json.damaged(fmt::format("{} is no {}", value.text(), zarr_name(type)));
  return value;
}

SampleValue parse_wide_fill_value(const JsonReader& json, WideType type) {
  if (type == WideType::boolean)
    return (json.raw().is_boolean() ? json.boolean() : parse_integer(json) != 0) ? 1 : 0;
  if (json.raw().is_string() && json.string().starts_with("0x") && json.string().size() == 6)
    return static_cast<double>(half_to_float(
        static_cast<std::uint16_t>(bits_to_double(json, ScalarType::u16, json.string()))));
  return parse_floating_fill_value(json, ScalarType::f32);
}

std::optional<ScalarType> parse_own_type(std::string_view name) {
  for (const ScalarType type : kScalarTypes)
    if (name == zarr_name(type)) return type;
  return std::nullopt;
}

std::vector<Index> parse_extents(const JsonReader& json, std::size_t dimensions) {
  if (json.array_size() != dimensions)
    json.damaged(fmt::format("has {} numbers, must have {}", json.array_size(), dimensions));
  std::vector<Index> extents(dimensions);
  for (std::size_t i = 0; i < dimensions; ++i) extents[i] = json.at(i).positive();
  return extents;
}

// The product of extents and `unit`, refused when above the limit.
void check_bytes(const JsonReader& json, std::span<const Index> extents, std::uint64_t unit) {
  std::uint64_t bytes = unit;
  for (const Index extent : extents) {
    if (static_cast<std::uint64_t>(extent) > kMaxBrickBytes / bytes)
      json.unsupported(
          fmt::format("more than {} bytes at a time are not supported", kMaxBrickBytes));
    bytes *= static_cast<std::uint64_t>(extent);
  }
}

// A codec is an object with a name or, without configuration, the name alone.
std::string codec_name(const JsonReader& codec) {
  return codec.raw().is_string() ? codec.string() : codec.string_at("name");
}

// Also those that Zarr-Python keeps under the names of numcodecs.
std::optional<ByteCodec> byte_codec(std::string_view name) {
  constexpr std::string_view other = "numcodecs.";
  if (name.starts_with(other)) name.remove_prefix(other.size());
  for (const ByteCodec codec : {ByteCodec::zstd, ByteCodec::crc32c, ByteCodec::gzip,
                                ByteCodec::zlib, ByteCodec::lz4, ByteCodec::blosc})
    if (name == name_of(codec)) return codec;
  return std::nullopt;
}

void check_packed_version(const JsonReader& codec) {
  const Index version = codec.at("configuration").at("version").integer();
  if (version != packed::kVersion)
    codec.unsupported(fmt::format("version {} of '{}' is not supported, only {}", version,
                                  kPackedName, packed::kVersion));
}

CodecChain parse_chain(const JsonReader& codecs, ScalarType type) {
  CodecChain chain;
  const std::size_t count = codecs.array_size();
  if (count == 0 || count > kMaxCodecs) codecs.damaged(fmt::format("{} codecs", count));
  for (std::size_t i = 0; i < count; ++i) {
    const JsonReader codec = codecs.at(i);
    const std::string name = codec_name(codec);
    if (i == 0 && name == kPackedName) {
      check_packed_version(codec);
      chain.packed = true;
    } else if (i == 0) {
      if (name != "bytes") codec.unsupported(fmt::format("codec '{}' is not supported here", name));
      if (codec.has("configuration") && codec.at("configuration").has("endian")) {
        const std::string endian = codec.at("configuration").string_at("endian");
        if (endian != "little" && endian != "big")
          codec.damaged(fmt::format("endian '{}' is neither little nor big", endian));
        chain.big_endian = endian == "big";
      } else if (size_of(type) > 1) {
        codec.damaged("'bytes' lacks its endian");
      }
    } else if (name == "zstd") {
      chain.steps.push_back(ByteCodec::zstd);
      if (codec.has("configuration") && codec.at("configuration").has("level"))
        chain.zstd_level = static_cast<int>(codec.at("configuration").at("level").integer());
    } else if (const auto step = byte_codec(name)) {
      if (*step != ByteCodec::crc32c && !can_decompress(*step))
        codec.unsupported(
            fmt::format("this program was built without what decompresses '{}'", name));
      chain.steps.push_back(*step);
    } else {
      codec.unsupported(fmt::format("codec '{}' is not supported", name));
    }
  }
  if (chain.packed && chain.steps != std::vector{ByteCodec::crc32c})
    codecs.unsupported(fmt::format("'{}' must be followed by crc32c alone", kPackedName));
  return chain;
}

/// Bricks are packed along the last three axes.
void check_packed_shape(const JsonReader& json, const ArrayMetadata& array) {
  if (!array.codecs.packed) return;
  const std::vector<Index>& brick = array.sharding ? array.sharding->brick : array.chunk;
  for (std::size_t i = 0; i + 3 < brick.size(); ++i)
    if (brick[i] != 1) json.unsupported("packed bricks of more than three axes are not supported");
  if (array.wide || brick.size() < 3)
    json.unsupported("only three axes of one of our own types are packed");
}

void parse_sharding(const JsonReader& codec, ArrayMetadata& array) {
  const JsonReader configuration = codec.at("configuration");
  ArrayMetadata::Sharding sharding;
  sharding.brick = parse_extents(configuration.at("chunk_shape"), array.shape.size());
  std::vector<Index> counts(sharding.brick.size());
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (array.chunk[i] % sharding.brick[i] != 0)
      configuration.damaged(fmt::format("bricks of {} do not divide shards of {}",
                                        sharding.brick[i], array.chunk[i]));
    counts[i] = array.chunk[i] / sharding.brick[i];
  }
  check_bytes(configuration, counts, ShardIndex::kEntryBytes);
  array.codecs = parse_chain(configuration.at("codecs"), array.type);
  const JsonReader index = configuration.at("index_codecs");
  const CodecChain chain = parse_chain(index, ScalarType::f64);
  if (chain.packed || chain.big_endian || chain.steps.size() > 1 ||
      (chain.steps.size() == 1 && chain.steps[0] != ByteCodec::crc32c))
    index.unsupported("only little-endian shard indices with or without crc32c are supported");
  sharding.index_has_crc = !chain.steps.empty();
  if (configuration.has("index_location")) {
    const std::string location = configuration.string_at("index_location");
    if (location != "start" && location != "end")
      configuration.damaged(fmt::format("index_location '{}' is neither start nor end", location));
    sharding.index_at_end = location == "end";
  }
  array.sharding = std::move(sharding);
}

void parse_key_encoding(const JsonReader& json, ArrayMetadata& array) {
  const std::string name = json.string_at("name");
  if (name != "default" && name != "v2")
    json.unsupported(fmt::format("chunk key encoding '{}' is not supported", name));
  array.key_prefix = name == "default";
  array.separator = array.key_prefix ? '/' : '.';
  if (json.has("configuration") && json.at("configuration").has("separator")) {
    const std::string separator = json.at("configuration").string_at("separator");
    if (separator != "/" && separator != ".")
      json.damaged(fmt::format("separator '{}' is neither / nor .", separator));
    array.separator = separator[0];
  }
}

// Unknown members must not be ignored unless they permit it.
void check_members(const JsonReader& json) {
  static constexpr std::string_view known[] = {
      "zarr_format",         "node_type",  "shape",  "data_type",       "chunk_grid",
      "attributes",          "fill_value", "codecs", "dimension_names", "chunk_key_encoding",
      "storage_transformers"};
  for (const auto& [key, value] : json.raw().items()) {
    bool is_known = false;
    for (const std::string_view name : known) is_known = is_known || key == name;
    const bool ignorable =
        value.is_object() && value.contains("must_understand") && value["must_understand"] == false;
    if (!is_known && !ignorable) json.unsupported(fmt::format("'{}' is not supported", key));
  }
  if (json.has("storage_transformers") && json.at("storage_transformers").array_size() != 0)
    json.unsupported("storage transformers are not supported");
}

}  // namespace

std::string ArrayMetadata::chunk_key(std::span<const Index> chunk_coordinates) const {
  std::string key(key_prefix ? 1 : 0, 'c');
  for (const Index coordinate : chunk_coordinates) {
    if (!key.empty()) key += separator;
    key += fmt::format("{}", coordinate);
  }
  return key;
}

std::string to_json(const ArrayMetadata& array) {
  Json codecs = codec_list(array.codecs);
  if (array.sharding) {
    CodecChain index_chain;
    if (array.sharding->index_has_crc) index_chain.steps.push_back(ByteCodec::crc32c);
    Json sharding = {{"chunk_shape", array.sharding->brick}};
    sharding["codecs"] = std::move(codecs);
    sharding["index_codecs"] = codec_list(index_chain);
    sharding["index_location"] = array.sharding->index_at_end ? "end" : "start";
    codecs = Json::array({named("sharding_indexed", std::move(sharding))});
  }
  Json json = Json::object();
  json["zarr_format"] = 3;
  json["node_type"] = "array";
  json["shape"] = array.shape;
  json["data_type"] = array.wide ? zarr_name(*array.wide) : zarr_name(array.type);
  json["chunk_grid"] = named("regular", {{"chunk_shape", array.chunk}});
  json["chunk_key_encoding"] =
      named(array.key_prefix ? "default" : "v2", {{"separator", std::string(1, array.separator)}});
  json["fill_value"] = fill_value_json(array.type, array.fill_value);
  json["codecs"] = std::move(codecs);
  json["attributes"] = Json::object();
  if (!array.dimension_names.empty()) json["dimension_names"] = array.dimension_names;
  return json.dump(2) + "\n";
}

ArrayMetadata parse_array_metadata(std::string_view text, const std::string& where) {
  const nlohmann::json parsed = parse_json(text, where);
  const JsonReader json(parsed, where);
  if (json.at("zarr_format").integer() != 3) json.unsupported("only Zarr version 3 is supported");
  if (json.string_at("node_type") != "array") json.damaged("must be an array");
  check_members(json);

  ArrayMetadata array;
  const JsonReader shape = json.at("shape");
  const std::size_t dimensions = shape.array_size();
  if (dimensions == 0 || dimensions > kMaxDimensions)
    shape.unsupported(fmt::format("{} dimensions are not supported", dimensions));
  array.shape = parse_extents(shape, dimensions);

  const JsonReader type = json.at("data_type");
  const std::string type_name = type.raw().is_string() ? type.string() : type.string_at("name");
  array.wide = parse_wide_type(type_name);
  const auto own = array.wide ? widened(*array.wide) : parse_own_type(type_name);
  if (!own) type.unsupported(fmt::format("data type '{}' is not supported", type_name));
  array.type = *own;

  const JsonReader grid = json.at("chunk_grid");
  if (const std::string name = grid.string_at("name"); name != "regular")
    grid.unsupported(fmt::format("chunk grid '{}' is not supported", name));
  array.chunk = parse_extents(grid.at("configuration").at("chunk_shape"), dimensions);
  parse_key_encoding(json.at("chunk_key_encoding"), array);
  array.fill_value = array.wide ? parse_wide_fill_value(json.at("fill_value"), *array.wide)
                                : parse_fill_value(json.at("fill_value"), array.type);

  const JsonReader codecs = json.at("codecs");
  if (codecs.array_size() == 1 && codec_name(codecs.at(std::size_t{0})) == "sharding_indexed") {
    parse_sharding(codecs.at(std::size_t{0}), array);
    check_bytes(codecs, array.sharding->brick, size_of(array.type));
  } else {
    array.codecs = parse_chain(codecs, array.type);
    check_bytes(codecs, array.chunk, size_of(array.type));
  }
  check_packed_shape(codecs, array);
  if (json.has("dimension_names") && json.raw()["dimension_names"].is_array()) {
    const JsonReader names = json.at("dimension_names");
    for (std::size_t i = 0; i < names.array_size(); ++i)
      array.dimension_names.push_back(names.raw()[i].is_string() ? names.at(i).string() : "");
  }
  return array;
}

std::string group_json() {
  Json json = Json::object();
  json["zarr_format"] = 3;
  json["node_type"] = "group";
  json["attributes"] = Json::object();
  return json.dump(2) + "\n";
}

}  // namespace isobrick

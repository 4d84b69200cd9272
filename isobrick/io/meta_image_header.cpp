#include "isobrick/io/meta_image_header.h"

#include <fmt/format.h>

#include <map>
#include <utility>

#include "isobrick/core/error.h"

namespace isobrick {
namespace {

/// `Key = Value` lines by key in lower case, up to ElementDataFile, which ends
/// the header.
class Fields {
 public:
  explicit Fields(const std::string& path) : path_(path), text_(read_header_text(path)) {
    std::string_view rest = text_;
    while (!rest.empty() && !fields_.contains("elementdatafile")) {
      const std::string_view line = next_line(rest);
      if (!trim(line).empty()) add(line);
    }
  }

  /// The value of the first of `keys` (spellings of one field) that is there.
  std::optional<std::string_view> find(std::initializer_list<const char*> keys) const {
    for (const char* key : keys)
      if (const auto at = fields_.find(lower(key)); at != fields_.end()) return at->second;
    return std::nullopt;
  }

  std::string_view need(const char* key) const {
    const auto value = find({key});
    if (!value) header_error(path_, fmt::format("'{}' is missing", key));
    return *value;
  }

  bool flag(std::initializer_list<const char*> keys) const {
    const auto value = find(keys);
    if (!value) return false;
    const std::string word = lower(*value);
    if (word != "true" && word != "false" && word != "1" && word != "0")
      header_error(path_, fmt::format("'{}' is neither True nor False", *keys.begin()));
    return word == "true" || word == "1";
  }

  /// Exactly `count` numbers.
  std::optional<std::vector<double>> reals(std::initializer_list<const char*> keys,
                                           std::size_t count) const {
    const auto value = find(keys);
    if (!value) return std::nullopt;
    std::vector<double> numbers;
    for (const auto word : words(*keys.begin(), *value, count))
      numbers.push_back(parse_real(path_, *keys.begin(), word));
    return numbers;
  }

  std::vector<std::string_view> words(const char* key, std::string_view value,
                                      std::size_t count) const {
    auto found = split_words(value);
    if (found.size() != count)
      header_error(path_, fmt::format("'{}' has {} entries, not {}", key, found.size(), count));
    return found;
  }

  const std::string& path() const { return path_; }

 private:
  void add(std::string_view line) {
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos)
      header_error(path_, "not a MetaImage header: a line is not 'Key = Value'");
    const std::string key = lower(trim(line.substr(0, equals)));
    if (!fields_.emplace(key, trim(line.substr(equals + 1))).second)
      header_error(path_, fmt::format("'{}' appears twice", key.substr(0, 60)));
  }

  std::string path_, text_;
  std::map<std::string, std::string_view> fields_;
};

ScalarType read_type(const Fields& fields) {
  // MET_LONG is missing on purpose: it has 4 or 8 bytes, depending on who wrote it.
  constexpr std::pair<std::string_view, ScalarType> types[] = {
      {"met_uchar", ScalarType::u8},   {"met_char", ScalarType::i8},
      {"met_ushort", ScalarType::u16}, {"met_short", ScalarType::i16},
      {"met_uint", ScalarType::u32},   {"met_int", ScalarType::i32},
      {"met_float", ScalarType::f32},  {"met_double", ScalarType::f64},
  };
  const std::string name = lower(fields.need("ElementType"));
  for (const auto& [spelling, type] : types)
    if (name == spelling) return type;
  header_error(fields.path(),
               fmt::format("samples of type '{}' are not supported", name.substr(0, 60)));
}

void refuse_unsupported(const Fields& fields) {
  if (parse_integer(fields.path(), "NDims", fields.need("NDims")) != 3)
    header_error(fields.path(), "NDims: only 3 is supported");
  if (fields.flag({"CompressedData"}))
    header_error(fields.path(), "compressed samples (CompressedData = True) are not supported");
  if (const auto binary = fields.find({"BinaryData"}); binary && !fields.flag({"BinaryData"}))
    header_error(fields.path(), "samples as text (BinaryData = False) are not supported");
  if (const auto channels = fields.find({"ElementNumberOfChannels"});
      channels && parse_integer(fields.path(), "ElementNumberOfChannels", *channels) != 1)
    header_error(fields.path(), "several channels (ElementNumberOfChannels) are not supported");
}

void read_layout(const Fields& fields, DetachedHeader& header) {
  const auto sizes = fields.words("DimSize", fields.need("DimSize"), 3);
  for (int i = 0; i < 3; ++i)
    header.extent[i] = parse_integer(fields.path(), "DimSize", sizes[static_cast<std::size_t>(i)]);
  header.type = read_type(fields);
  const bool big = fields.flag({"ElementByteOrderMSB", "BinaryDataByteOrderMSB"});
  header.order = big ? ByteOrder::big : ByteOrder::little;
  if (const auto text = fields.find({"HeaderSize"})) {
    const Index skip = parse_integer(fields.path(), "HeaderSize", *text);
    if (skip < -1) header_error(fields.path(), "HeaderSize is negative");
    header.data_at_end = skip == -1;
    header.skip_bytes = skip > 0 ? static_cast<std::uint64_t>(skip) : 0;
  }
  const std::string_view data = fields.need("ElementDataFile");
  if (lower(data) == "local")
    header_error(fields.path(),
                 "samples in the same file as the header (ElementDataFile = LOCAL) "
                 "are not supported");
  header.data_path = resolve_data_file(fields.path(), data);
}

void read_transform(const Fields& fields, Transform& transform) {
  // The numbers of an axis stand together: a column of the matrix after another.
  const auto matrix = fields.reals({"TransformMatrix", "Orientation", "Rotation"}, 9);
  if (matrix) {
    const auto& m = *matrix;
    const Vec3d axes[3] = {{m[0], m[1], m[2]}, {m[3], m[4], m[5]}, {m[6], m[7], m[8]}};
    set_axes(fields.path(), transform, axes);
  }
  transform.spacing = {1, 1, 1};
  if (const auto spacing = fields.reals({"ElementSpacing", "ElementSize"}, 3))
    transform.spacing = {(*spacing)[0], (*spacing)[1], (*spacing)[2]};
  for (int i = 0; i < 3; ++i)
    if (transform.spacing[i] <= 0) header_error(fields.path(), "ElementSpacing is not positive");
  if (const auto origin = fields.reals({"Offset", "Position", "Origin"}, 3))
    transform.origin = {(*origin)[0], (*origin)[1], (*origin)[2]};
  if (const auto unit = fields.find({"DistanceUnits"})) transform.unit = unit_name(*unit);
}

}  // namespace

DetachedHeader parse_meta_image_header(const std::string& path) {
  const Fields fields(path);
  refuse_unsupported(fields);
  DetachedHeader header;
  header.path = path;
  read_layout(fields, header);
  read_transform(fields, header.transform);
  return header;
}

}  // namespace isobrick

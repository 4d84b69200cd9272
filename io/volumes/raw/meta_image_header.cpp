#include "io/volumes/raw/meta_image_header.h"

#include <fmt/format.h>

#include <map>
#include <utility>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "core/printable.h"

namespace isobrick::inline v0 {
namespace {

/// `Key = Value` lines by key in lower case, up to ElementDataFile, which ends
/// the header.
class Fields {
 public:
  explicit Fields(const std::string& path) : path_(path), lines_(path) {
    while (!lines_.at_end() && !fields_.contains("elementdatafile")) {
      const std::string_view line = lines_.next();
      if (!trim(line).empty()) add(line);
    }
    size_ = lines_.position();
    const auto data = find({"ElementDataFile"});
    if (!data || !is_list(*data)) return;
    while (!lines_.at_end())
      if (const std::string_view name = trim(lines_.next()); !name.empty()) list_.push_back(name);
  }

  static bool is_list(std::string_view data) {
    const auto words = split_words(data);
    return !words.empty() && lower(words[0]) == "list";
  }

  /// The names that follow "ElementDataFile = LIST".
  const std::vector<std::string_view>& list() const { return list_; }
  /// Bytes of the header.
  std::uint64_t size() const { return size_; }

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
      header_error(path_, fmt::format("'{}' appears twice", printable(key, 60)));
  }

  std::string path_;
  HeaderLines lines_;
  std::map<std::string, std::string_view> fields_;
  std::vector<std::string_view> list_;
  std::uint64_t size_ = 0;
};

ScalarType read_type(const Fields& fields) {
  // MET_LONG is missing on purpose: it has 4 or 8 bytes, depending on who wrote it.
  constexpr std::pair<std::string_view, ScalarType> types[] = {
      {"met_uchar", ScalarType::u8},       {"met_char", ScalarType::i8},
      {"met_ushort", ScalarType::u16},     {"met_short", ScalarType::i16},
      {"met_uint", ScalarType::u32},       {"met_int", ScalarType::i32},
      {"met_ulong_long", ScalarType::u64}, {"met_long_long", ScalarType::i64},
      {"met_float", ScalarType::f32},      {"met_double", ScalarType::f64},
  };
  const std::string name = lower(fields.need("ElementType"));
  for (const auto& [spelling, type] : types)
    if (name == spelling) return type;
  header_error(fields.path(),
               fmt::format("samples of type '{}' are not supported", printable(name, 60)));
}

/// Returns how many dimensions the header's matrices and vectors have.
std::size_t read_view(const Fields& fields, const Selection& selection, TextHeader& header) {
  const Index dimensions = parse_integer(fields.path(), "NDims", fields.need("NDims"));
  if (dimensions != 3 && dimensions != 4)
    header_error(fields.path(),
                 fmt::format("NDims = {}: 3, and 4 with time, are supported", dimensions));
  std::vector<ArrayAxis> axes;
  if (const auto channels = fields.find({"ElementNumberOfChannels"}))
    axes.push_back(
        {parse_integer(fields.path(), "ElementNumberOfChannels", *channels), AxisRole::channel});
  const auto count = static_cast<std::size_t>(dimensions);
  const auto sizes = fields.words("DimSize", fields.need("DimSize"), count);
  for (std::size_t i = 0; i < count; ++i)
    axes.push_back({parse_integer(fields.path(), "DimSize", sizes[i]),
                    i < 3 ? AxisRole::space : AxisRole::time});
  header.view = select_volume(fields.path(), axes, selection);
  return count;
}

Encoding read_encoding(const Fields& fields) {
  const bool text = fields.find({"BinaryData"}) && !fields.flag({"BinaryData"});
  if (!fields.flag({"CompressedData"})) return text ? Encoding::text : Encoding::raw;
  if (text) header_error(fields.path(), "compressed text is not supported");
  return Encoding::zlib;
}

std::vector<std::string> read_data_paths(const Fields& fields) {
  const std::string_view data = fields.need("ElementDataFile");
  if (lower(data) == "local") return {fields.path()};
  if (Fields::is_list(data)) {
    std::vector<std::string> paths;
    for (const auto name : fields.list()) paths.push_back(resolve_data_file(fields.path(), name));
    if (paths.empty()) header_error(fields.path(), "the list of data files is empty");
    return paths;
  }
  if (data.find('%') != std::string_view::npos) return resolve_data_pattern(fields.path(), data);
  return {resolve_data_file(fields.path(), data)};
}

void read_layout(const Fields& fields, TextHeader& header) {
  header.type = read_type(fields);
  header.encoding = read_encoding(fields);
  const bool big = fields.flag({"ElementByteOrderMSB", "BinaryDataByteOrderMSB"});
  header.order = big ? ByteOrder::big : ByteOrder::little;
  header.data_paths = read_data_paths(fields);
  if (header.attached()) {
    header.data_begin = fields.size();
    return;  // HeaderSize is about files of samples
  }
  if (const auto text = fields.find({"HeaderSize"})) {
    const Index skip = parse_integer(fields.path(), "HeaderSize", *text);
    if (skip < -1) header_error(fields.path(), "HeaderSize is negative");
    header.data_at_end = skip == -1;
    header.skip_bytes = skip > 0 ? static_cast<std::uint64_t>(skip) : 0;
  }
}

/// The first three of as many numbers as there are dimensions.
std::optional<Vec3d> read_vector(const Fields& fields, std::initializer_list<const char*> keys,
                                 std::size_t dimensions) {
  const auto numbers = fields.reals(keys, dimensions);
  if (!numbers) return std::nullopt;
  return Vec3d{(*numbers)[0], (*numbers)[1], (*numbers)[2]};
}

void read_transform(const Fields& fields, std::size_t dimensions, Transform& transform) {
  // The numbers of an axis stand together: a column of the matrix after another.
  const auto matrix =
      fields.reals({"TransformMatrix", "Orientation", "Rotation"}, dimensions * dimensions);
  if (matrix) {
    Vec3d axes[3];
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        axes[i][static_cast<int>(j)] = (*matrix)[i * dimensions + j];
    set_axes(fields.path(), transform, axes);
  }
  transform.spacing =
      read_vector(fields, {"ElementSpacing", "ElementSize"}, dimensions).value_or(Vec3d{1, 1, 1});
  for (int i = 0; i < 3; ++i)
    if (transform.spacing[i] <= 0) header_error(fields.path(), "ElementSpacing is not positive");
  if (const auto origin = read_vector(fields, {"Offset", "Position", "Origin"}, dimensions))
    transform.origin = *origin;
  if (const auto unit = fields.find({"DistanceUnits"})) transform.unit = unit_name(*unit);
}

}  // namespace

TextHeader parse_meta_image_header(const std::string& path, const Selection& selection) {
  const Fields fields(path);
  TextHeader header;
  header.path = path;
  const std::size_t dimensions = read_view(fields, selection, header);
  read_layout(fields, header);
  read_transform(fields, dimensions, header.transform);
  return header;
}

}  // namespace isobrick

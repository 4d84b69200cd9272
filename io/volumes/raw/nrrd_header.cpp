#include "io/volumes/raw/nrrd_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <span>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "core/printable.h"
#include "io/volumes/raw/slicer_segments.h"

namespace isobrick::inline v0 {
namespace {

std::optional<ScalarType> parse_type(const std::string& name) {
  struct TypeNames {
    ScalarType type;
    std::array<std::string_view, 7> names;
  };
  static constexpr TypeNames all[] = {
      {ScalarType::i8, {"signed char", "int8", "int8_t"}},
      {ScalarType::u8, {"uchar", "unsigned char", "uint8", "uint8_t"}},
      {ScalarType::i16,
       {"short", "short int", "signed short", "signed short int", "int16", "int16_t"}},
      {ScalarType::u16, {"ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"}},
      {ScalarType::i32, {"int", "signed int", "int32", "int32_t"}},
      {ScalarType::u32, {"uint", "unsigned int", "uint32", "uint32_t"}},
      {ScalarType::i64,
       {"longlong", "long long", "long long int", "signed long long", "signed long long int",
        "int64", "int64_t"}},
      {ScalarType::u64,
       {"ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"}},
      {ScalarType::f32, {"float"}},
      {ScalarType::f64, {"double"}},
  };
  if (name.empty()) return std::nullopt;
  for (const TypeNames& s : all)
    if (std::find(s.names.begin(), s.names.end(), name) != s.names.end()) return s.type;
  return std::nullopt;
}

/// A number without digits that are lost; nothing where the text is none.
std::optional<SampleValue> parse_number(const std::string& text) {
  const auto parse = [&](auto value) -> std::optional<SampleValue> {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
    return value;
  };
  if (const auto value = parse(std::int64_t{})) return value;
  if (const auto value = parse(std::uint64_t{})) return value;
  return parse(0.0);
}

/// The fields by name, names in lower case without blanks ("data file" and
/// "datafile" are one).
class Fields {
 public:
  explicit Fields(const std::string& path) : path_(path), lines_(path) {
    const std::string_view magic = lines_.next();
    if (magic.size() != 8 || !magic.starts_with("NRRD000") || magic[7] < '1' || magic[7] > '5')
      header_error(path, "not a NRRD header: it does not begin with NRRD0001 … NRRD0005");
    while (!lines_.at_end()) {
      const std::string_view line = lines_.next();
      if (trim(line).empty()) break;
      if (!line.starts_with('#')) add(line);
      if (listed_) read_list();
    }
  }

  /// The names that follow "data file: LIST".
  const std::vector<std::string_view>& list() const { return list_; }
  /// Bytes of the header.
  std::uint64_t size() const { return lines_.position(); }

  std::optional<std::string_view> find(const std::string& name) const {
    const auto at = fields_.find(name);
    return at == fields_.end() ? std::nullopt : std::optional(at->second);
  }

  /// The value of a key/value pair ("key:=value"); empty where it is not there.
  std::string pair(const std::string& key) const {
    const auto at = pairs_.find(key);
    return at == pairs_.end() ? std::string() : unescaped(at->second);
  }

  std::string_view need(const std::string& name) const {
    const auto value = find(name);
    if (!value) header_error(path_, fmt::format("the field '{}' is missing", name));
    return *value;
  }

  const std::string& path() const { return path_; }

 private:
  void add(std::string_view line) {
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos)
      header_error(path_, "a line is neither a field nor a comment");
    if (line.substr(colon).starts_with(":=")) {
      pairs_[std::string(line.substr(0, colon))] = line.substr(colon + 2);
      return;
    }
    std::string name = lower(line.substr(0, colon));
    std::erase(name, ' ');
    const std::string_view value = trim(line.substr(colon + 1));
    if (!fields_.emplace(name, value).second)
      header_error(path_, fmt::format("the field '{}' appears twice", printable(name, 60)));
    listed_ = name == "datafile" && (value == "LIST" || value.starts_with("LIST "));
  }

  void read_list() {
    while (!lines_.at_end())
      if (const std::string_view name = trim(lines_.next()); !name.empty()) list_.push_back(name);
  }

  /// A value may have line ends and backslashes as \n and \\.
  static std::string unescaped(std::string_view value) {
    std::string text;
    for (std::size_t i = 0; i < value.size(); ++i) {
      const bool escape = value[i] == '\\' && i + 1 < value.size();
      text += !escape ? value[i] : value[++i] == 'n' ? '\n' : value[i];
    }
    return text;
  }

  std::string path_;
  HeaderLines lines_;
  std::map<std::string, std::string_view> fields_, pairs_;
  std::vector<std::string_view> list_;
  bool listed_ = false;
};

/// One entry an axis.
std::vector<std::string_view> per_axis(const Fields& fields, std::size_t dimension,
                                       const std::string& name,
                                       std::vector<std::string_view> words) {
  if (words.size() != dimension)
    header_error(fields.path(), fmt::format("'{}' has {} entries for {} dimensions", name,
                                            words.size(), dimension));
  return words;
}

/// Entries are separated by blanks, but vectors and strings may hold blanks:
/// "(1, 0, 0) none", "\"mm\" \"mm\"".
std::vector<std::string_view> split_entries(const Fields& fields, std::string_view text) {
  std::vector<std::string_view> entries;
  for (text = trim(text); !text.empty(); text = trim(text)) {
    const char close = text[0] == '(' ? ')' : text[0] == '"' ? '"' : ' ';
    std::size_t end = text.find(close, 1);
    if (end == std::string_view::npos) {
      if (close != ' ') header_error(fields.path(), fmt::format("a '{}' is missing", close));
      end = text.size();
    } else if (close != ' ') {
      ++end;
    }
    entries.push_back(text.substr(0, end));
    text.remove_prefix(end);
  }
  return entries;
}

Vec3d parse_vector(const Fields& fields, const std::string& name, std::string_view entry) {
  if (entry.size() < 2 || entry.front() != '(' || entry.back() != ')')
    header_error(fields.path(), fmt::format("'{}' is not made of vectors '(x,y,z)'", name));
  std::string inside(entry.substr(1, entry.size() - 2));
  std::replace(inside.begin(), inside.end(), ',', ' ');
  const auto words = split_words(inside);
  if (words.size() != 3)
    header_error(fields.path(), fmt::format("'{}': only space of 3 dimensions is supported", name));
  Vec3d vector;
  for (int i = 0; i < 3; ++i)
    vector[i] = parse_real(fields.path(), name, words[static_cast<std::size_t>(i)]);
  return vector;
}

/// The role of an axis by its kind; nullopt where that leaves it open.
std::optional<AxisRole> role_of_kind(const std::string& kind) {
  if (kind == "domain" || kind == "space") return AxisRole::space;
  if (kind == "time") return AxisRole::time;
  if (kind == "???" || kind == "none" || kind.empty()) return std::nullopt;
  return AxisRole::channel;  // lists, vectors, colours, matrices, …
}

bool three_of_space(std::span<const ArrayAxis> axes) {
  return std::count_if(axes.begin(), axes.end(),
                       [](const ArrayAxis& axis) { return axis.role == AxisRole::space; }) == 3;
}

/// Roles by the field 'kinds', else by which axes have a direction in space.
/// True when that leaves three of space.
bool find_roles(const Fields& fields, std::vector<ArrayAxis>& axes) {
  if (const auto text = fields.find("kinds")) {
    const auto kinds = per_axis(fields, axes.size(), "kinds", split_words(*text));
    for (std::size_t i = 0; i < axes.size(); ++i)
      axes[i].role = role_of_kind(lower(kinds[i])).value_or(AxisRole::channel);
    if (three_of_space(axes)) return true;
  }
  if (const auto text = fields.find("spacedirections")) {
    const auto entries =
        per_axis(fields, axes.size(), "space directions", split_entries(fields, *text));
    for (std::size_t i = 0; i < axes.size(); ++i)
      axes[i].role = lower(entries[i]) == "none" ? AxisRole::channel : AxisRole::space;
    if (three_of_space(axes)) return true;
  }
  for (ArrayAxis& axis : axes) axis.role = AxisRole::space;
  return axes.size() == 3;
}

/// Returns how many axes the array has.
std::size_t read_view(const Fields& fields, const Selection& selection, TextHeader& header) {
  constexpr Index kMaxDimensions = 16;
  const Index dimension = parse_integer(fields.path(), "dimension", fields.need("dimension"));
  if (dimension < 3 || dimension > kMaxDimensions)
    header_error(
        fields.path(),
        fmt::format("dimension {}: volumes have 3, or more with channels and times", dimension));
  std::vector<ArrayAxis> axes;
  for (const auto word : per_axis(fields, static_cast<std::size_t>(dimension), "sizes",
                                  split_words(fields.need("sizes"))))
    axes.push_back({parse_integer(fields.path(), "sizes", word), AxisRole::space});
  if (!find_roles(fields, axes) && !guess_roles(axes, selection))
    header_error(fields.path(),
                 fmt::format("{} dimensions, and neither 'kinds' nor 'space directions' mark which "
                             "3 are space: {}",
                             axes.size(), kRolesHint));
  header.view = select_volume(fields.path(), axes, selection);
  return axes.size();
}

Encoding read_encoding(const Fields& fields) {
  const std::string name = lower(fields.need("encoding"));
  if (name == "raw") return Encoding::raw;
  if (name == "gzip" || name == "gz") return Encoding::gzip;
  if (name == "text" || name == "txt" || name == "ascii") return Encoding::text;
  header_error(fields.path(), fmt::format("encoding '{}' is not supported; raw, gzip and text are",
                                          printable(name, 60)));
}

/// Checks the word that may follow the others of a list or a pattern: how many dimensions
/// the samples of each file have. The files follow one another whatever it is.
void check_subdim(const Fields& fields, std::string_view word) {
  const Index subdim = parse_integer(fields.path(), "data file", word);
  const Index dimension = parse_integer(fields.path(), "dimension", fields.need("dimension"));
  if (subdim < 1 || subdim > dimension)
    header_error(fields.path(),
                 fmt::format("'data file': files of {} dimensions cannot make one of {}", subdim,
                             dimension));
}

/// PATTERN FIRST LAST STEP [SUBDIM]
std::vector<std::string> read_data_pattern(const Fields& fields, std::string_view text) {
  const auto words = split_words(text);
  if (words.size() != 5) return resolve_data_pattern(fields.path(), text);
  check_subdim(fields, words[4]);
  const auto length = static_cast<std::size_t>(words[4].data() - text.data());
  return resolve_data_pattern(fields.path(), trim(text.substr(0, length)));
}

std::vector<std::string> read_data_paths(const Fields& fields) {
  const auto data = fields.find("datafile");
  if (!data) return {fields.path()};
  if (data->starts_with("LIST") && (data->size() == 4 || (*data)[4] == ' ')) {
    if (const auto subdim = trim(data->substr(4)); !subdim.empty()) check_subdim(fields, subdim);
    std::vector<std::string> paths;
    for (const auto name : fields.list()) paths.push_back(resolve_data_file(fields.path(), name));
    if (paths.empty()) header_error(fields.path(), "the list of data files is empty");
    return paths;
  }
  if (data->find('%') != std::string_view::npos) return read_data_pattern(fields, *data);
  return {resolve_data_file(fields.path(), *data)};
}

void read_layout(const Fields& fields, TextHeader& header) {
  const std::string type = lower(fields.need("type"));
  if (const auto known = parse_type(type))
    header.type = *known;
  else
    header_error(fields.path(),
                 fmt::format("samples of type '{}' are not supported", printable(type, 60)));
  header.encoding = read_encoding(fields);
  if (const auto endian = fields.find("endian")) {
    const std::string order = lower(*endian);
    if (order != "little" && order != "big")
      header_error(fields.path(), "'endian' is neither little nor big");
    header.order = order == "big" ? ByteOrder::big : ByteOrder::little;
  }
  header.data_paths = read_data_paths(fields);
  if (header.attached()) header.data_begin = fields.size();
}

void read_skips(const Fields& fields, TextHeader& header) {
  const auto number = [&](const char* name) {
    const auto text = fields.find(name);
    return text ? parse_integer(fields.path(), name, *text) : Index{0};
  };
  const Index lines = number("lineskip"), bytes = number("byteskip");
  if (lines < 0 || bytes < -1)
    header_error(fields.path(), "'line skip' or 'byte skip' is negative");
  header.data_at_end = bytes == -1;
  header.skip_lines = static_cast<std::uint64_t>(lines);
  header.skip_bytes = bytes > 0 ? static_cast<std::uint64_t>(bytes) : 0;
}

void read_spacings(const Fields& fields, std::size_t dimension, const ArrayView& view,
                   Transform& transform) {
  const auto text = fields.find("spacings");
  if (!text) return;
  const auto words = per_axis(fields, dimension, "spacings", split_words(*text));
  for (int i = 0; i < 3; ++i) {
    const double spacing =
        parse_real(fields.path(), "spacings", words[view.kept[static_cast<std::size_t>(i)]], true);
    if (spacing <= 0) header_error(fields.path(), "a spacing is not positive");
    if (!std::isnan(spacing)) transform.spacing[i] = spacing;  // NaN: not known
  }
}

void read_directions(const Fields& fields, std::size_t dimension, const ArrayView& view,
                     Transform& transform) {
  if (const auto text = fields.find("spacedirections")) {
    const auto entries =
        per_axis(fields, dimension, "space directions", split_entries(fields, *text));
    Vec3d steps[3];
    for (std::size_t i = 0; i < 3; ++i)
      steps[i] = parse_vector(fields, "space directions", entries[view.kept[i]]);
    set_axes(fields.path(), transform, steps);
  }
  if (const auto text = fields.find("spaceorigin"))
    transform.origin = parse_vector(fields, "space origin", *text);
}

/// The unit that all kept entries share, or none.
std::string read_unit(const Fields& fields, const std::string& name, std::size_t count,
                      const std::array<std::size_t, 3>& kept) {
  const auto text = fields.find(name);
  if (!text) return {};
  auto entries = split_entries(fields, *text);
  if (entries.size() != count) return {};
  for (auto& entry : entries)
    if (entry.size() >= 2 && entry.front() == '"') entry = entry.substr(1, entry.size() - 2);
  const std::string first = unit_name(entries[kept[0]]);
  const bool shared = unit_name(entries[kept[1]]) == first && unit_name(entries[kept[2]]) == first;
  return shared ? first : std::string();
}

/// What export keeps of a grid in key/value pairs.
void read_grid(const Fields& fields, TextHeader& header) {
  constexpr std::size_t kMaxClass = 100, kMaxName = 1000;
  header.grid_class = printable(fields.pair(kNrrdGridClass), kMaxClass);
  header.grid_name = printable(fields.pair(kNrrdGridName), kMaxName);
  const std::string fill = fields.pair(kNrrdFillValue);
  if (fill.empty()) return;
  const auto value = parse_number(fill);
  if (!value || !is_sample(*value, header.type))
    header_error(fields.path(), fmt::format("'{}': '{}' is no {}", kNrrdFillValue,
                                            printable(fill, 60), short_name(header.type)));
  header.fill_value = *value;
}

}  // namespace

TextHeader parse_nrrd_header(const std::string& path, const Selection& selection) {
  const Fields fields(path);
  TextHeader header;
  header.path = path;
  const std::size_t dimension = read_view(fields, selection, header);
  read_layout(fields, header);
  read_skips(fields, header);
  read_spacings(fields, dimension, header.view, header.transform);
  read_directions(fields, dimension, header.view, header.transform);
  header.transform.unit = read_unit(fields, "spaceunits", 3, {0, 1, 2});
  if (header.transform.unit.empty())
    header.transform.unit = read_unit(fields, "units", dimension, header.view.kept);
  read_grid(fields, header);
  header.labels = read_slicer_segments([&](const std::string& key) { return fields.pair(key); },
                                       selection.channel.value_or(0));
  return header;
}

}  // namespace isobrick

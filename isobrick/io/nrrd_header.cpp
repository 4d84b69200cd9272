#include "isobrick/io/nrrd_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>

#include "isobrick/core/error.h"

namespace isobrick {
namespace {

std::optional<ScalarType> parse_type(const std::string& name) {
  struct Spellings {
    ScalarType type;
    std::array<std::string_view, 6> names;
  };
  static constexpr Spellings all[] = {
      {ScalarType::i8, {"signed char", "int8", "int8_t"}},
      {ScalarType::u8, {"uchar", "unsigned char", "uint8", "uint8_t"}},
      {ScalarType::i16,
       {"short", "short int", "signed short", "signed short int", "int16", "int16_t"}},
      {ScalarType::u16, {"ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"}},
      {ScalarType::i32, {"int", "signed int", "int32", "int32_t"}},
      {ScalarType::u32, {"uint", "unsigned int", "uint32", "uint32_t"}},
      {ScalarType::f32, {"float"}},
      {ScalarType::f64, {"double"}},
  };
  if (name.empty()) return std::nullopt;
  for (const Spellings& s : all)
    if (std::find(s.names.begin(), s.names.end(), name) != s.names.end()) return s.type;
  return std::nullopt;
}

/// The fields by name, names in lower case without blanks ("data file" and
/// "datafile" are one).
class Fields {
 public:
  explicit Fields(const std::string& path) : path_(path), text_(read_header_text(path)) {
    std::string_view rest = text_;
    const std::string_view magic = next_line(rest);
    if (magic.size() != 8 || !magic.starts_with("NRRD000") || magic[7] < '1' || magic[7] > '5')
      header_error(path, "not a NRRD header: it does not begin with NRRD0001 … NRRD0005");
    while (!rest.empty()) {
      const std::string_view line = next_line(rest);
      if (trim(line).empty()) break;
      if (!line.starts_with('#')) add(line);
    }
  }

  std::optional<std::string_view> find(const std::string& name) const {
    const auto at = fields_.find(name);
    return at == fields_.end() ? std::nullopt : std::optional(at->second);
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
    if (line.substr(colon).starts_with(":=")) return;  // key/value pair
    std::string name = lower(line.substr(0, colon));
    std::erase(name, ' ');
    if (!fields_.emplace(name, trim(line.substr(colon + 1))).second)
      header_error(path_, fmt::format("the field '{}' appears twice", name.substr(0, 60)));
  }

  std::string path_, text_;
  std::map<std::string, std::string_view> fields_;
};

/// Which of the file's axes are x, y and z: all three or, of four, those left
/// without one of extent 1.
struct Axes {
  std::size_t dimension = 3;
  std::array<std::size_t, 3> kept{0, 1, 2};
};

/// One word an axis.
std::vector<std::string_view> per_axis(const Fields& fields, const Axes& axes,
                                       const std::string& name,
                                       std::vector<std::string_view> words) {
  if (words.size() != axes.dimension)
    header_error(fields.path(), fmt::format("'{}' has {} entries for {} dimensions", name,
                                            words.size(), axes.dimension));
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

Axes read_extent(const Fields& fields, DetachedHeader& header) {
  Axes axes;
  const Index dimension = parse_integer(fields.path(), "dimension", fields.need("dimension"));
  if (dimension != 3 && dimension != 4)
    header_error(fields.path(), fmt::format("dimension {}: only volumes of 3 dimensions (or 4, "
                                            "one of them of size 1) are supported",
                                            dimension));
  axes.dimension = static_cast<std::size_t>(dimension);
  const auto words = per_axis(fields, axes, "sizes", split_words(fields.need("sizes")));
  std::vector<Index> sizes;
  for (const auto word : words) sizes.push_back(parse_integer(fields.path(), "sizes", word));
  if (axes.dimension == 4) {
    const auto single =
        static_cast<std::size_t>(std::find(sizes.begin(), sizes.end(), Index{1}) - sizes.begin());
    if (single == 4)
      header_error(fields.path(),
                   "4 dimensions, none of size 1: several samples a point or "
                   "time steps are not supported");
    for (std::size_t i = 0; i < 3; ++i) axes.kept[i] = i < single ? i : i + 1;
  }
  for (int i = 0; i < 3; ++i) header.extent[i] = sizes[axes.kept[static_cast<std::size_t>(i)]];
  return axes;
}

void read_layout(const Fields& fields, DetachedHeader& header) {
  const std::string type = lower(fields.need("type"));
  if (const auto known = parse_type(type))
    header.type = *known;
  else
    header_error(fields.path(),
                 fmt::format("samples of type '{}' are not supported", type.substr(0, 60)));
  const std::string encoding = lower(fields.need("encoding"));
  if (encoding != "raw")
    header_error(fields.path(),
                 fmt::format("encoding '{}' is not supported, only 'raw'", encoding.substr(0, 60)));
  if (const auto endian = fields.find("endian")) {
    const std::string order = lower(*endian);
    if (order != "little" && order != "big")
      header_error(fields.path(), "'endian' is neither little nor big");
    header.order = order == "big" ? ByteOrder::big : ByteOrder::little;
  }
  const auto data = fields.find("datafile");
  if (!data)
    header_error(fields.path(),
                 "the field 'data file' is missing; samples in the same file as "
                 "the header are not supported");
  header.data_path = resolve_data_file(fields.path(), *data);
}

void read_skips(const Fields& fields, DetachedHeader& header) {
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

void read_spacings(const Fields& fields, const Axes& axes, Transform& transform) {
  const auto text = fields.find("spacings");
  if (!text) return;
  const auto words = per_axis(fields, axes, "spacings", split_words(*text));
  for (int i = 0; i < 3; ++i) {
    const double spacing =
        parse_real(fields.path(), "spacings", words[axes.kept[static_cast<std::size_t>(i)]], true);
    if (spacing <= 0) header_error(fields.path(), "a spacing is not positive");
    if (!std::isnan(spacing)) transform.spacing[i] = spacing;  // NaN: not known
  }
}

void read_directions(const Fields& fields, const Axes& axes, Transform& transform) {
  if (const auto text = fields.find("spacedirections")) {
    const auto entries = per_axis(fields, axes, "space directions", split_entries(fields, *text));
    Vec3d steps[3];
    for (std::size_t i = 0; i < 3; ++i)
      steps[i] = parse_vector(fields, "space directions", entries[axes.kept[i]]);
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
  const std::string_view first = entries[kept[0]];
  return entries[kept[1]] == first && entries[kept[2]] == first ? unit_name(first) : std::string();
}

}  // namespace

DetachedHeader parse_nrrd_header(const std::string& path) {
  const Fields fields(path);
  DetachedHeader header;
  header.path = path;
  const Axes axes = read_extent(fields, header);
  read_layout(fields, header);
  read_skips(fields, header);
  read_spacings(fields, axes, header.transform);
  read_directions(fields, axes, header.transform);
  header.transform.unit = read_unit(fields, "spaceunits", 3, {0, 1, 2});
  if (header.transform.unit.empty())
    header.transform.unit = read_unit(fields, "units", axes.dimension, axes.kept);
  return header;
}

}  // namespace isobrick

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include "isobrick/core/error.h"
#include "isobrick/render/mesh_parts_reader.h"
#include "isobrick/render/mesh_readers.h"

namespace isobrick {
namespace {

constexpr std::size_t kMostHeader = 1 << 20;

struct Property {
  std::string name;
  NumberKind kind{};
  bool list = false;
  NumberKind count_kind{};
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;

  /// Bytes of one, if all are alike.
  std::optional<std::uint64_t> row_bytes() const {
    std::uint64_t bytes = 0;
    for (const Property& property : properties) {
      if (property.list) return std::nullopt;
      bytes += size_of(property.kind);
    }
    return bytes;
  }
};

struct Header {
  bool swapped = false;
  std::vector<Element> elements;
  std::size_t bytes = 0;
  std::string unit;
};

[[noreturn]] void damaged(const std::string& path, const std::string& what) {
  throw Error(fmt::format("'{}' is no PLY file that can be drawn: {}", path, what));
}

NumberKind parse_kind(const std::string& path, std::string_view word) {
  static constexpr std::array<std::pair<std::string_view, NumberKind>, 16> kinds{
      {{"char", NumberKind::i8},
       {"int8", NumberKind::i8},
       {"uchar", NumberKind::u8},
       {"uint8", NumberKind::u8},
       {"short", NumberKind::i16},
       {"int16", NumberKind::i16},
       {"ushort", NumberKind::u16},
       {"uint16", NumberKind::u16},
       {"int", NumberKind::i32},
       {"int32", NumberKind::i32},
       {"uint", NumberKind::u32},
       {"uint32", NumberKind::u32},
       {"float", NumberKind::f32},
       {"float32", NumberKind::f32},
       {"double", NumberKind::f64},
       {"float64", NumberKind::f64}}};
  for (const auto& [name, kind] : kinds)
    if (name == word) return kind;
  damaged(path, fmt::format("'{}' is no type of a property", word));
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t at = 0; at < line.size();) {
    const std::size_t begin = line.find_first_not_of(" \t\r", at);
    if (begin == line.npos) break;
    const std::size_t end = std::min(line.find_first_of(" \t\r", begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    at = end;
  }
  return words;
}

void take_format(const std::string& path, Header& header, std::string_view word) {
  if (word == "ascii") damaged(path, "it is text; write it as binary PLY");
  if (word != "binary_little_endian" && word != "binary_big_endian")
    damaged(path, fmt::format("its format is '{}'", word));
  header.swapped = word == "binary_big_endian";
}

void take_element(const std::string& path, Header& header,
                  const std::vector<std::string_view>& words) {
  Element& element = header.elements.emplace_back();
  element.name = words[1];
  const auto [end, error] =
      std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
  if (error != std::errc() || end != words[2].data() + words[2].size())
    damaged(path, fmt::format("'{}' is no number of elements", words[2]));
}

void take_property(const std::string& path, Header& header,
                   const std::vector<std::string_view>& words) {
  if (header.elements.empty()) damaged(path, "a property belongs to no element");
  std::vector<Property>& properties = header.elements.back().properties;
  if (words.size() == 3)
    properties.push_back({std::string(words[2]), parse_kind(path, words[1])});
  else if (words.size() == 5 && words[1] == "list")
    properties.push_back(
        {std::string(words[4]), parse_kind(path, words[3]), true, parse_kind(path, words[2])});
  else
    damaged(path, "a property is not of the form TYPE NAME");
}

Header parse_header(const std::string& path, std::string_view text) {
  Header header;
  text = text.substr(0, kMostHeader);
  for (std::size_t at = 0;;) {
    const std::size_t end = text.find('\n', at);
    if (end == text.npos) damaged(path, "its header does not end");
    const std::string_view line = text.substr(at, end - at);
    const std::vector<std::string_view> words = words_of(line);
    at = end + 1;
    constexpr std::string_view comment = "comment ";
    if (header.unit.empty() && line.starts_with(comment))
      header.unit = unit_of_comment(line.substr(comment.size()));
    if (words.empty() || words[0] == "ply" || words[0] == "comment" || words[0] == "obj_info")
      continue;
    if (words[0] == "end_header") {
      header.bytes = at;
      return header;
    }
    if (words[0] == "format" && words.size() == 3)
      take_format(path, header, words[1]);
    else if (words[0] == "element" && words.size() == 3)
      take_element(path, header, words);
    else if (words[0] == "property")
      take_property(path, header, words);
    else
      damaged(path, fmt::format("its header says '{}'", words[0]));
  }
}

/// The field of the properties `names`, if the element has all three.
std::optional<VertexField> field_of(const Element& element,
                                    const std::array<std::string_view, 3>& names,
                                    const std::byte* first, bool swapped) {
  VertexField field{.first = first, .stride = *element.row_bytes(), .swapped = swapped};
  for (std::size_t i = 0; i < 3; ++i) {
    std::uint32_t offset = 0;
    bool found = false;
    for (const Property& property : element.properties) {
      if (property.name == names[i]) {
        field.offsets[i] = offset;
        field.kinds[i] = property.kind;
        found = true;
        break;
      }
      offset += static_cast<std::uint32_t>(size_of(property.kind));
    }
    if (!found) return std::nullopt;
  }
  return field;
}

/// Reads faces row by row; polygons become fans.
class PlyTriangles final : public TriangleReader {
 public:
  PlyTriangles(std::string path, const Element& faces, std::span<const std::byte> bytes,
               bool swapped)
      : path_(std::move(path)), faces_(faces), rest_(bytes), swapped_(swapped) {}

  bool next(std::array<std::uint64_t, 3>& triangle) override {
    while (corner_ + 1 >= corners_) {
      if (row_ == faces_.count) return false;
      read_row();
      ++row_;
    }
    triangle = {vertex(0), vertex(corner_), vertex(corner_ + 1)};
    ++corner_;
    return true;
  }

 private:
  const std::byte* take(std::uint64_t size) {
    if (size > rest_.size())
      damaged(path_, fmt::format("it ends within face {} of {}", row_, faces_.count));
    const std::byte* at = rest_.data();
    rest_ = rest_.subspan(static_cast<std::size_t>(size));
    return at;
  }

  void read_row() {
    corners_ = 0;
    corner_ = 1;
    for (const Property& property : faces_.properties) {
      if (!property.list) {
        take(size_of(property.kind));
        continue;
      }
      const double count =
          load_number(take(size_of(property.count_kind)), property.count_kind, swapped_);
      if (!(count >= 0) || count > 1e9)
        damaged(path_, fmt::format("face {} has {} vertices", row_, count));
      const auto whole = static_cast<std::uint64_t>(count);
      const std::byte* at = take(whole * size_of(property.kind));
      if (property.name != "vertex_indices" && property.name != "vertex_index") continue;
      list_ = at;
      kind_ = property.kind;
      corners_ = whole;
    }
  }

  std::uint64_t vertex(std::uint64_t corner) const {
    const double number = load_number(list_ + corner * size_of(kind_), kind_, swapped_);
    // Negative ones are no vertex of any file.
    return number >= 0 && number < 0x1p53 ? static_cast<std::uint64_t>(number)
                                          : std::numeric_limits<std::uint64_t>::max();
  }

  std::string path_;
  Element faces_;
  std::span<const std::byte> rest_;
  bool swapped_;
  std::uint64_t row_ = 0, corners_ = 0, corner_ = 1;
  const std::byte* list_ = nullptr;
  NumberKind kind_{};
};

bool has_indices(const Element& faces) {
  for (const Property& property : faces.properties)
    if (property.list && (property.name == "vertex_indices" || property.name == "vertex_index"))
      return true;
  return false;
}

}  // namespace

std::unique_ptr<MeshFile> read_ply(const std::string& path, std::shared_ptr<MappedFile> file) {
  const std::span<const std::byte> bytes = file->bytes();
  const Header header =
      parse_header(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  std::span<const std::byte> rest = bytes.subspan(header.bytes);
  IndexedPart part;
  bool vertices = false;
  for (const Element& element : header.elements) {
    if (element.name == "face" && vertices) {
      if (!has_indices(element)) damaged(path, "its faces name no vertices");
      // Every face takes a byte at least, which also bounds what is claimed.
      if (element.count > rest.size())
        damaged(path, fmt::format("{} faces cannot be in {} bytes", element.count, rest.size()));
      part.faces = element.count;
      part.open_triangles = [path, element, rest, swapped = header.swapped] {
        return std::make_unique<PlyTriangles>(path, element, rest, swapped);
      };
      return std::make_unique<IndexedMeshFile>(
          path, std::vector{std::move(part)},
          std::vector<std::shared_ptr<const void>>{std::move(file)}, header.unit);
    }
    const std::optional<std::uint64_t> row = element.row_bytes();
    if (!row) damaged(path, fmt::format("its element '{}' has lists", element.name));
    if (*row > 0 && element.count > rest.size() / *row)
      damaged(path, fmt::format("{} elements '{}' of {} bytes are beyond its end", element.count,
                                element.name, *row));
    if (element.name == "vertex") {
      const auto positions = field_of(element, {"x", "y", "z"}, rest.data(), header.swapped);
      if (!positions) damaged(path, "its vertices have no x, y, z");
      vertices = true;
      part.vertices = element.count;
      part.positions = *positions;
      part.normals = field_of(element, {"nx", "ny", "nz"}, rest.data(), header.swapped);
    }
    rest = rest.subspan(static_cast<std::size_t>(*row * element.count));
  }
  damaged(path, "it has no vertices followed by faces");
}

}  // namespace isobrick

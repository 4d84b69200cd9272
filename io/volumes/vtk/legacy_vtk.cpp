#include "io/volumes/vtk/legacy_vtk.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "core/printable.h"
#include "io/bytes/file_stream.h"
#include "io/bytes/text_stream.h"
#include "io/volumes/raw/raw_source.h"
#include "io/volumes/raw/text_header.h"
#include "io/volumes/stream_source.h"

namespace isobrick::inline v0 {
namespace {

struct Header {
  ArrayView view;
  ScalarType type;
  Transform transform;
  bool text = false;
  bool fractions = false;  ///< the text holds u8 as fractions of 255
  std::uint64_t begin = 0;
};

/// Samples of u8 from a text of fractions of 255, as COLOR_SCALARS has them.
class FractionStream final : public ByteStream {
 public:
  explicit FractionStream(std::unique_ptr<ByteStream> text)
      : numbers_(make_text_stream(std::move(text), ScalarType::f32)) {}

  std::size_t read(std::byte* out, std::size_t size) override {
    std::size_t done = 0;
    while (done < size) {
      std::array<float, 1024> part;
      const std::size_t wanted = std::min(size - done, part.size());
      const std::size_t got =
          numbers_->read(reinterpret_cast<std::byte*>(part.data()), wanted * sizeof(float)) /
          sizeof(float);
      for (std::size_t i = 0; i < got; ++i) out[done++] = byte_of(part[i]);
      if (got < wanted) break;
    }
    return done;
  }

  std::string name() const override { return numbers_->name(); }
  std::uint64_t max_bytes() const override { return numbers_->max_bytes() / sizeof(float); }
  std::size_t memory() const override { return numbers_->memory(); }

 private:
  std::byte byte_of(float fraction) const {
    if (!(fraction >= 0 && fraction <= 1))
      throw Error(fmt::format("{}: the fraction {} among its COLOR_SCALARS is not from 0 to 1",
                              name(), fraction));
    return static_cast<std::byte>(std::lround(fraction * 255));
  }

  std::unique_ptr<ByteStream> numbers_;
};

ScalarType read_type(const std::string& path, const std::string& name) {
  // long is missing on purpose: it has 4 or 8 bytes, depending on who wrote it.
  constexpr std::pair<std::string_view, ScalarType> types[] = {
      {"unsigned_char", ScalarType::u8}, {"char", ScalarType::i8},
      {"signed_char", ScalarType::i8},   {"unsigned_short", ScalarType::u16},
      {"short", ScalarType::i16},        {"unsigned_int", ScalarType::u32},
      {"int", ScalarType::i32},          {"float", ScalarType::f32},
      {"double", ScalarType::f64},       {"vtktypeint64", ScalarType::i64},
      {"vtktypeuint64", ScalarType::u64}};
  for (const auto& [known, type] : types)
    if (name == known) return type;
  header_error(path, fmt::format("samples of type '{}' are not supported", printable(name, 60)));
}

/// Reads keyword by keyword up to the samples.
class Parser {
 public:
  Parser(const std::string& path, const Selection& selection)
      : path_(path), selection_(selection), lines_(path) {}

  Header parse() {
    lines_.next();
    lines_.next();  // the title
    std::string encoding;
    while (encoding.empty() && !lines_.at_end()) encoding = lower(trim(lines_.next()));
    if (encoding != "ascii" && encoding != "binary")
      header_error(path_, fmt::format("'{}' is neither ASCII nor BINARY", printable(encoding, 60)));
    header_.text = encoding == "ascii";
    while (!found_) {
      if (lines_.at_end()) header_error(path_, "there are no samples");
      const auto words = split_words(lines_.next());
      if (!words.empty()) take(lower(words[0]), words);
    }
    header_.begin = lines_.position();
    finish();
    return header_;
  }

 private:
  using Words = std::vector<std::string_view>;

  void take(const std::string& key, const Words& words) {
    if (key == "dataset") {
      if (words.size() < 2 || lower(words[1]) != "structured_points")
        header_error(path_, "only a DATASET of STRUCTURED_POINTS is supported");
    } else if (key == "dimensions") {
      for (int i = 0; i < 3; ++i) points_[i] = parse_integer(path_, key, word(words, i + 1));
    } else if (key == "spacing" || key == "aspect_ratio") {
      for (int i = 0; i < 3; ++i) spacing_[i] = parse_real(path_, key, word(words, i + 1));
    } else if (key == "origin") {
      for (int i = 0; i < 3; ++i) origin_[i] = parse_real(path_, key, word(words, i + 1));
    } else if (key == "point_data" || key == "cell_data") {
      cells_ = key == "cell_data";
      tuples_ = parse_integer(path_, key, word(words, 1));
    } else if (tuples_ && key == "scalars") {
      take_scalars(words);
    } else if (tuples_ && key == "color_scalars") {
      header_.fractions = header_.text;
      header_.type = ScalarType::u8;
      components_ = parse_integer(path_, key, word(words, 2));
      found_ = true;
    } else if (tuples_ && key == "field") {
      take_field();
    } else if (key == "field") {
      skip_field(parse_integer(path_, key, word(words, 2)));
    } else if (key == "metadata") {
      skip_metadata();
    } else {
      header_error(path_, fmt::format("'{}' is not supported{}", printable(key, 60),
                                      tuples_ ? " before the SCALARS" : ""));
    }
  }

  std::string_view word(const Words& words, int i) const {
    if (words.size() <= static_cast<std::size_t>(i))
      header_error(path_, fmt::format("'{}' has too few words", printable(words[0], 60)));
    return words[static_cast<std::size_t>(i)];
  }

  void take_scalars(const Words& words) {
    header_.type = read_type(path_, lower(word(words, 2)));
    components_ = words.size() > 3 ? parse_integer(path_, "SCALARS", words[3]) : 1;
    if (lower(lines_.rest().substr(0, 12)) == "lookup_table") lines_.next();
    found_ = true;
  }

  /// NAME COMPONENTS TUPLES TYPE, of which the first array is taken.
  void take_field() {
    const auto words = split_words(lines_.next());
    if (words.size() < 4)
      header_error(path_, "FIELD: an array is not 'NAME COMPONENTS TUPLES TYPE'");
    components_ = parse_integer(path_, "FIELD", words[1]);
    if (parse_integer(path_, "FIELD", words[2]) != *tuples_)
      header_error(path_, "FIELD: an array is not as long as its data set");
    header_.type = read_type(path_, lower(words[3]));
    found_ = true;
  }

  /// Field data of the whole data set, in front of its samples: NAME COMPONENTS TUPLES TYPE and
  /// values, each array with its metadata.
  void skip_field(Index arrays) {
    while (arrays > 0) {
      if (lines_.at_end()) header_error(path_, "FIELD: an array is missing");
      const auto words = split_words(lines_.next());
      if (words.empty()) continue;
      if (lower(words[0]) == "metadata") {
        skip_metadata();
        continue;
      }
      const Index components = parse_integer(path_, "FIELD", word(words, 1)),
                  tuples = parse_integer(path_, "FIELD", word(words, 2));
      constexpr auto most = static_cast<Index>(kMaxHeader);
      if (components < 0 || tuples < 0 || components > most || tuples > most)
        header_error(path_, "FIELD: the size of an array makes no sense");
      const std::string type = lower(word(words, 3));
      const auto values = static_cast<std::uint64_t>(components * tuples);
      if (type == "string")
        header_.text ? skip_lines(values) : skip_packed_strings(values);
      else
        header_.text ? skip_numbers(values) : lines_.skip(bytes_of_values(type, values));
      --arrays;
    }
  }

  /// A block that ends at an empty line.
  void skip_metadata() {
    while (!lines_.at_end() && !trim(lines_.next()).empty()) continue;
  }

  void skip_lines(std::uint64_t count) {
    for (; count > 0 && !lines_.at_end(); --count) lines_.next();
  }

  void skip_numbers(std::uint64_t count) {
    for (std::uint64_t seen = 0; seen < count && !lines_.at_end();)
      seen += split_words(lines_.next()).size();
  }

  /// Each after its length, whose highest two bits are the number of further bytes that it has.
  void skip_packed_strings(std::uint64_t count) {
    for (; count > 0; --count) {
      if (lines_.at_end()) header_error(path_, "FIELD: a text is missing");
      const auto first = static_cast<unsigned char>(lines_.rest().front());
      const std::size_t length_bytes = std::size_t{1} << (3 - (first >> 6));
      std::uint64_t length = first & 0x3F;
      for (std::size_t i = 1; i < std::min(length_bytes, lines_.rest().size()); ++i)
        length = length << 8 | static_cast<unsigned char>(lines_.rest()[i]);
      lines_.skip(length_bytes);
      lines_.skip(length);
    }
  }

  std::uint64_t bytes_of_values(const std::string& type, std::uint64_t count) const {
    if (type == "bit") return (count + 7) / 8;
    if (type == "vtkidtype") return count * 4;
    if (type == "vtktypeint64" || type == "vtktypeuint64") return count * 8;
    if (type == "long" || type == "unsigned_long") {
      // 8 or 4 bytes, depending on who wrote it; a line ends behind the values.
      const std::string_view rest = lines_.rest();
      const bool wide =
          count * 8 < rest.size() && rest[static_cast<std::size_t>(count * 8)] == '\n';
      return count * (wide ? 8 : 4);
    }
    return count * size_of(read_type(path_, type));
  }

  void finish() {
    const Int3 extent = cells_ ? points_ - Int3{1, 1, 1} : points_;
    const ArrayAxis axes[] = {{components_, AxisRole::channel},
                              {extent.x, AxisRole::space},
                              {extent.y, AxisRole::space},
                              {extent.z, AxisRole::space}};
    header_.view = select_volume(path_, axes, selection_);
    if (header_.view.total / components_ != *tuples_)
      header_error(path_, fmt::format("{} data for {} x {} x {} samples", *tuples_, extent.x,
                                      extent.y, extent.z));
    const Vec3d axis[3] = {{spacing_.x, 0, 0}, {0, spacing_.y, 0}, {0, 0, spacing_.z}};
    set_axes(path_, header_.transform, axis);
    header_.transform.origin = origin_;
    if (cells_) header_.transform.origin = header_.transform.apply({0.5, 0.5, 0.5});
  }

  const std::string& path_;
  const Selection& selection_;
  HeaderLines lines_;
  Header header_;
  Int3 points_;
  Vec3d spacing_{1, 1, 1}, origin_;
  std::optional<Index> tuples_;
  Index components_ = 1;
  bool cells_ = false, found_ = false;
};

}  // namespace

std::unique_ptr<VolumeSource> open_legacy_vtk(const std::string& path,
                                              const VolumeRequest& request) {
  refuse_raw_description(path, "a VTK file", request);
  const Header header = Parser(path, request.selection).parse();
  const std::size_t sample = size_of(header.type);
  SampleLayout layout;
  layout.info = describe_volume(path, header.view.extent, header.type, header.transform, request);
  layout.offset = static_cast<std::uint64_t>(header.view.first) * sample;
  layout.stride = header.view.stride;
  File file = open_input(path);
  if (header.text) {
    const std::uint64_t total = static_cast<std::uint64_t>(header.view.total) * sample;
    auto text = make_file_stream(std::move(file), header.begin);
    auto samples = header.fractions ? std::make_unique<FractionStream>(std::move(text))
                                    : make_text_stream(std::move(text), header.type);
    return make_stream_source(std::move(layout), std::move(samples), total, AfterEnd::unread);
  }
  layout.offset += header.begin;
  layout.swap = sample > 1 && kNativeOrder != ByteOrder::big;
  check_header_promise(layout, file);
  return make_raw_source(std::move(layout), std::move(file));
}

}  // namespace isobrick

#include "io/volumes/vtk/vti_header.h"

#include <expat.h>
#include <fmt/format.h>

#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "io/bytes/file.h"
#include "io/volumes/raw/text_header.h"

namespace isobrick {
namespace {

using Attributes = std::map<std::string, std::string>;

/// One <DataArray>.
struct ArrayElement {
  Attributes attributes;
  bool cells = false;
  std::uint64_t content = 0;  ///< where its own text begins
};

/// The elements of the file that matter, as they come.
class Reader {
 public:
  Reader(const std::string& path, std::string wanted)
      : path_(path), wanted_(std::move(wanted)), parser_(XML_ParserCreate(nullptr)) {
    XML_SetUserData(parser_.get(), this);
    XML_SetElementHandler(parser_.get(), on_start, on_end);
    XML_SetStartDoctypeDeclHandler(parser_.get(), on_doctype);
  }

  void read() {
    const File file = open_input(path_);
    const std::uint64_t end = file.size();
    constexpr std::uint64_t kPiece = 1 << 16, kMaxToken = 1 << 20;
    std::vector<char> buffer(kPiece);
    for (std::uint64_t at = 0; at < end && !done_; at += kPiece) {
      const auto size = static_cast<std::size_t>(std::min(kPiece, end - at));
      file.read_at(at, std::as_writable_bytes(std::span(buffer).first(size)));
      const auto status = XML_Parse(parser_.get(), buffer.data(), static_cast<int>(size), 0);
      if (failure_) std::rethrow_exception(failure_);
      if (done_) return;
      if (status != XML_STATUS_OK)
        header_error(path_, fmt::format("not XML at byte {}: {}", position(),
                                        XML_ErrorString(XML_GetErrorCode(parser_.get()))));
      if (at + size > position() + kMaxToken)
        header_error(path_, fmt::format("the XML has no end of an element or a name for {} bytes "
                                        "from byte {} on",
                                        kMaxToken, position()));
    }
    if (!done_) header_error(path_, "the XML ends before the array of samples is found");
  }

  const Attributes& file() const { return file_; }
  const Attributes& image() const { return image_; }
  const Attributes& piece() const { return piece_; }
  const ArrayElement& array() const { return *array_; }
  const Attributes& appended() const { return appended_; }
  std::uint64_t appended_content() const { return appended_content_; }

 private:
  struct Free {
    void operator()(XML_Parser parser) const { XML_ParserFree(parser); }
  };

  std::uint64_t position() const {
    const XML_Index at = XML_GetCurrentByteIndex(parser_.get());
    return at < 0 ? 0 : static_cast<std::uint64_t>(at);
  }
  std::uint64_t after_tag() const {
    return position() + static_cast<std::uint64_t>(XML_GetCurrentByteCount(parser_.get()));
  }

  // Exceptions must not pass through expat.
  template <class F>
  static void guarded(void* self, F&& f) {
    Reader& reader = *static_cast<Reader*>(self);
    if (reader.failure_ || reader.done_) return;
    try {
      f(reader);
    } catch (...) {
      reader.failure_ = std::current_exception();
    }
    if (reader.failure_ || reader.done_) XML_StopParser(reader.parser_.get(), XML_FALSE);
  }
  static void on_start(void* self, const XML_Char* name, const XML_Char** words) {
    guarded(self, [&](Reader& reader) {
      Attributes attributes;
      for (; *words != nullptr; words += 2) attributes[words[0]] = words[1];
      reader.start(name, std::move(attributes));
    });
  }
  static void on_end(void* self, const XML_Char* name) {
    guarded(self, [&](Reader& reader) { reader.end(name); });
  }
  static void on_doctype(void* self, const XML_Char*, const XML_Char*, const XML_Char*, int) {
    guarded(self,
            [](Reader& reader) { header_error(reader.path_, "a DOCTYPE has no place here"); });
  }

  void start(const std::string& name, Attributes attributes) {
    if (file_.empty() && (name != "VTKFile" || attributes["type"] != "ImageData"))
      header_error(path_, fmt::format("the XML is a {} of type '{}', not a VTKFile of ImageData",
                                      name.substr(0, 60), attributes["type"].substr(0, 60)));
    if (name == "VTKFile") file_ = std::move(attributes);
    if (name == "ImageData") image_ = std::move(attributes);
    if (name == "Piece") {
      if (!piece_.empty()) header_error(path_, "images of several pieces are not supported");
      piece_ = std::move(attributes);
    }
    if (name == "PointData" || name == "CellData") {
      section_ = name;
      scalars_[name] = attributes["Scalars"];
    }
    if (name == "DataArray" && !section_.empty()) start_array(std::move(attributes));
    if (name == "AppendedData") {
      appended_ = std::move(attributes);
      appended_content_ = after_tag();
      choose_array();
    }
  }

  void start_array(Attributes attributes) {
    constexpr std::size_t kMaxArrays = 10000;
    if (arrays_.size() == kMaxArrays) header_error(path_, "there are too many arrays");
    arrays_.push_back({std::move(attributes), section_ == "CellData", after_tag()});
  }

  void end(const std::string& name) {
    if (name == section_) section_.clear();
    // Text inside of the XML was passed over to get here; it is read again.
    if (name == "Piece" && !arrays_.empty() && all_inline()) choose_array();
  }

  bool all_inline() const {
    for (const ArrayElement& array : arrays_)
      if (const auto format = array.attributes.find("format");
          format != array.attributes.end() && format->second == "appended")
        return false;
    return true;
  }

  std::string names() const {
    std::string text;
    for (const ArrayElement& array : arrays_)
      if (const auto name = array.attributes.find("Name"); name != array.attributes.end())
        text += (text.empty() ? "'" : ", '") + name->second.substr(0, 60) + "'";
    return text.substr(0, 600);
  }

  std::optional<ArrayElement> find(bool cells, const std::string& name) const {
    std::optional<ArrayElement> found;
    for (const ArrayElement& array : arrays_) {
      if (array.cells != cells) continue;
      const auto own = array.attributes.find("Name");
      if (!name.empty() && (own == array.attributes.end() || own->second != name)) continue;
      if (found) return std::nullopt;  // without a name: not the only one
      found = array;
    }
    return found;
  }

  void choose_array() {
    for (const bool cells : {false, true}) {
      const std::string& scalars = scalars_[cells ? "CellData" : "PointData"];
      if (!array_) array_ = find(cells, wanted_.empty() ? scalars : wanted_);
    }
    if (!array_ && arrays_.empty()) header_error(path_, "there is no array of point or cell data");
    if (!array_)
      header_error(
          path_,
          wanted_.empty()
              ? fmt::format("none of its arrays ({}) is marked as the scalars: choose "
                            "one as '{}:/NAME'",
                            names(), path_)
              : fmt::format("there is no array '{}' among {}", wanted_.substr(0, 60), names()));
    done_ = true;
  }

  std::string path_, wanted_, section_;
  std::unique_ptr<XML_ParserStruct, Free> parser_;
  std::exception_ptr failure_;
  bool done_ = false;
  Attributes file_, image_, piece_, appended_;
  std::map<std::string, std::string> scalars_;
  std::vector<ArrayElement> arrays_;
  std::optional<ArrayElement> array_;
  std::uint64_t appended_content_ = 0;
};

std::string value_of(const Attributes& attributes, const char* name, const char* fallback) {
  const auto at = attributes.find(name);
  return at == attributes.end() ? fallback : at->second;
}

std::vector<double> reals(const std::string& path, const Attributes& attributes, const char* name,
                          const char* fallback, std::size_t count) {
  std::vector<double> numbers;
  const std::string text = value_of(attributes, name, fallback);
  for (const auto word : split_words(text)) numbers.push_back(parse_real(path, name, word));
  if (numbers.size() != count)
    header_error(path, fmt::format("{} has {} numbers, not {}", name, numbers.size(), count));
  return numbers;
}

/// First and one after the last sample, as the attribute `name` says.
Box3 read_extent(const std::string& path, const char* name, const std::string& text) {
  const auto words = split_words(text);
  if (words.size() != 6) header_error(path, fmt::format("{} does not have 6 numbers", name));
  Box3 box;
  constexpr Index kMax = Index{1} << 31;
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<std::size_t>(2 * axis);
    box.lo[axis] = parse_integer(path, name, words[at]);
    box.hi[axis] = parse_integer(path, name, words[at + 1]);
    if (box.lo[axis] < -kMax || box.hi[axis] > kMax || box.hi[axis] < box.lo[axis])
      header_error(path, fmt::format("{}: {} {} makes no sense", name, box.lo[axis], box.hi[axis]));
    ++box.hi[axis];
  }
  return box;
}

ScalarType read_type(const std::string& path, const std::string& name) {
  constexpr std::pair<std::string_view, ScalarType> types[] = {
      {"UInt8", ScalarType::u8},    {"Int8", ScalarType::i8},    {"UInt16", ScalarType::u16},
      {"Int16", ScalarType::i16},   {"UInt32", ScalarType::u32}, {"Int32", ScalarType::i32},
      {"Float32", ScalarType::f32}, {"Float64", ScalarType::f64}};
  for (const auto& [known, type] : types)
    if (name == known) return type;
  header_error(path, fmt::format("samples of type '{}' are not supported", name.substr(0, 60)));
}

Transform read_transform(const std::string& path, const Attributes& image, Int3 first, bool cells) {
  const auto direction = reals(path, image, "Direction", "1 0 0 0 1 0 0 0 1", 9);
  const auto spacing = reals(path, image, "Spacing", "1 1 1", 3);
  const auto origin = reals(path, image, "Origin", "0 0 0", 3);
  Vec3d axes[3];
  for (std::size_t i = 0; i < 9; ++i)
    axes[i % 3][static_cast<int>(i / 3)] = direction[i] * spacing[i % 3];
  Transform transform;
  set_axes(path, transform, axes);
  transform.origin = {origin[0], origin[1], origin[2]};
  // The world's origin is that of index 0, which need not be the first sample.
  Vec3d shift;
  for (int axis = 0; axis < 3; ++axis)
    shift[axis] = static_cast<double>(first[axis]) + (cells ? 0.5 : 0);
  transform.origin = transform.apply(shift);
  return transform;
}

/// Where the first character is that is no blank.
std::uint64_t after_blanks(const std::string& path, std::uint64_t at) {
  constexpr std::uint64_t kMaxBlanks = 4096;
  const std::string text = open_input(path).text_at(at, kMaxBlanks);
  return at + std::min(text.find_first_not_of(" \t\r\n"), text.size());
}

void read_samples_of(const std::string& path, const Reader& reader, VtiHeader& header) {
  const Attributes& array = reader.array().attributes;
  header.type = read_type(path, value_of(array, "type", ""));
  const std::string order = value_of(reader.file(), "byte_order", "LittleEndian");
  header.order = order == "BigEndian" ? ByteOrder::big : ByteOrder::little;
  const std::string size_type = value_of(reader.file(), "header_type", "UInt32");
  if (size_type != "UInt32" && size_type != "UInt64")
    header_error(path, fmt::format("header_type '{}' is not known", size_type.substr(0, 60)));
  header.size_bytes = size_type == "UInt64" ? 8 : 4;
  const std::string compressor = value_of(reader.file(), "compressor", "");
  header.compressed = !compressor.empty();
  const std::string format = value_of(array, "format", "ascii");
  if (format == "appended") {
    const std::string encoding = value_of(reader.appended(), "encoding", "raw");
    header.encoding = encoding == "base64" ? VtiEncoding::base64 : VtiEncoding::raw;
    const Index offset = parse_integer(path, "offset", value_of(array, "offset", "0"));
    if (offset < 0) header_error(path, "a negative offset");
    header.begin = static_cast<std::uint64_t>(offset);
  } else if (format == "ascii" || format == "binary") {
    header.encoding = format == "ascii" ? VtiEncoding::ascii : VtiEncoding::base64;
    header.begin = reader.array().content;
  } else {
    header_error(path, fmt::format("the format '{}' is not known", format.substr(0, 60)));
  }
  if (header.compressed && compressor != "vtkZLibDataCompressor" &&
      header.encoding != VtiEncoding::ascii)
    header_error(path, fmt::format("compression by {} is not supported, only vtkZLibDataCompressor",
                                   compressor.substr(0, 60)));
  if (header.encoding == VtiEncoding::ascii) return;
  if (format != "appended") {
    header.begin = after_blanks(path, header.begin);
    return;
  }
  // The underscore marks where the offsets count from.
  const std::uint64_t mark = after_blanks(path, reader.appended_content());
  const File file = open_input(path);
  if (file.text_at(mark, 1) != "_") header_error(path, "the appended data do not begin with '_'");
  if (header.begin > file.size() - mark - 1)
    header_error(path, "the array's offset is behind the end");
  header.begin += mark + 1;
}

}  // namespace

VtiHeader parse_vti_header(const std::string& path, const std::string& array,
                           const Selection& selection) {
  Reader reader(path, array);
  reader.read();
  VtiHeader header;
  const std::string whole = value_of(reader.image(), "WholeExtent", "");
  const Box3 box = read_extent(path, "WholeExtent", whole);
  if (!(read_extent(path, "Extent", value_of(reader.piece(), "Extent", whole.c_str())) == box))
    header_error(path, "the piece is not the whole extent, which is not supported");
  const Attributes& chosen = reader.array().attributes;
  const Int3 extent = reader.array().cells ? box.extent() - Int3{1, 1, 1} : box.extent();
  const Index components =
      parse_integer(path, "NumberOfComponents", value_of(chosen, "NumberOfComponents", "1"));
  const ArrayAxis axes[] = {{components, AxisRole::channel},
                            {extent.x, AxisRole::space},
                            {extent.y, AxisRole::space},
                            {extent.z, AxisRole::space}};
  header.view = select_volume(path, axes, selection);
  header.transform = read_transform(path, reader.image(), box.lo, reader.array().cells);
  read_samples_of(path, reader, header);
  return header;
}

}  // namespace isobrick

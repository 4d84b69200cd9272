#include "io/meshes/readers/vtp_header.h"

#include <expat.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <exception>
#include <memory>
#include <string_view>
#include <utility>

#include <isobrick/error.h>

namespace isobrick {
namespace {

constexpr std::size_t kMaxArrays = 10'000, kMaxParts = 1'000'000;

/// The elements that matter, as they come.
class Parser {
 public:
  Parser(const std::string& path, std::span<const std::byte> bytes)
      : path_(path), bytes_(bytes), parser_(XML_ParserCreate(nullptr)) {
    XML_SetUserData(parser_.get(), this);
    XML_SetElementHandler(parser_.get(), on_start, on_end);
    XML_SetStartDoctypeDeclHandler(parser_.get(), on_doctype);
  }

  VtpHeader parse() {
    constexpr std::size_t piece = std::size_t{1} << 20;
    for (std::size_t at = 0; at < bytes_.size() && !done_; at += piece) {
      const auto part = bytes_.subspan(at, std::min(piece, bytes_.size() - at));
      const auto status =
          XML_Parse(parser_.get(), reinterpret_cast<const char*>(part.data()),
                    static_cast<int>(part.size()), at + part.size() == bytes_.size() ? 1 : 0);
      if (failure_) std::rethrow_exception(failure_);
      if (status != XML_STATUS_OK && !done_)
        fail_vtp(path_, fmt::format("its XML, byte {}: {}", position(),
                                    XML_ErrorString(XML_GetErrorCode(parser_.get()))));
    }
    if (header_.file.attributes.empty()) fail_vtp(path_, "it is empty");
    return std::move(header_);
  }

 private:
  struct Free {
    void operator()(XML_Parser parser) const { XML_ParserFree(parser); }
  };

  std::uint64_t position() const {
    return static_cast<std::uint64_t>(
        std::max<XML_Index>(XML_GetCurrentByteIndex(parser_.get()), 0));
  }
  std::uint64_t after_tag() const {
    return position() + static_cast<std::uint64_t>(XML_GetCurrentByteCount(parser_.get()));
  }

  // Exceptions must not pass through expat.
  template <class F>
  static void guarded(void* self, F&& f) {
    Parser& parser = *static_cast<Parser*>(self);
    if (parser.failure_ || parser.done_) return;
    try {
      f(parser);
    } catch (...) {
      parser.failure_ = std::current_exception();
    }
    if (parser.failure_ || parser.done_) XML_StopParser(parser.parser_.get(), XML_FALSE);
  }
  static void on_start(void* self, const XML_Char* name, const XML_Char** words) {
    guarded(self, [&](Parser& parser) {
      VtkArray element{.content = parser.after_tag()};
      for (; *words != nullptr; words += 2) element.attributes[words[0]] = words[1];
      parser.start(name, std::move(element));
    });
  }
  static void on_end(void* self, const XML_Char* name) {
    guarded(self, [&](Parser& parser) {
      if (name == parser.section_) parser.section_.clear();
    });
  }
  static void on_doctype(void* self, const XML_Char*, const XML_Char*, const XML_Char*, int) {
    guarded(self, [](Parser& parser) { fail_vtp(parser.path_, "a DOCTYPE has no place here"); });
  }

  void start(const std::string& name, VtkArray element) {
    if (header_.file.attributes.empty()) {
      const std::string type = element.get("type");
      if (name != "VTKFile" || (type != "PolyData" && type != "PPolyData"))
        fail_vtp(path_, fmt::format("it is a {} of type '{}', not a VTKFile of PolyData",
                                    name.substr(0, 60), type.substr(0, 60)));
      header_.file = std::move(element);
    } else if (name == "Piece") {
      add_piece(element);
    } else if (name == "AppendedData") {
      header_.appended = std::move(element);
      find_data();
      done_ = true;
    } else if (name == "DataArray" || name == "Array") {
      add_array(std::move(element));
    } else if (name == "FieldData" || name == "PointData" || name == "Points" || name == "Polys") {
      section_ = name;
      if (name == "PointData" && !header_.pieces.empty()) {
        header_.pieces.back().normals = element.get("Normals");
        header_.pieces.back().scalars = element.get("Scalars");
      }
    }
  }

  void add_piece(const VtkArray& element) {
    if (const std::string source = element.get("Source"); !source.empty()) {
      if (header_.sources.size() == kMaxParts) fail_vtp(path_, "it has too many parts");
      header_.sources.push_back(source);
      return;
    }
    if (header_.pieces.size() == kMaxArrays) fail_vtp(path_, "it has too many pieces");
    header_.pieces.push_back({.points = count_of(element, "NumberOfPoints"),
                              .polygons = count_of(element, "NumberOfPolys"),
                              .strips = count_of(element, "NumberOfStrips")});
  }

  void add_array(VtkArray element) {
    if (section_ == "FieldData" && element.get("Name") == "unit") header_.unit = element;
    if (header_.pieces.empty()) return;
    VtpPiece& piece = header_.pieces.back();
    std::vector<VtkArray>* const arrays = section_ == "PointData" ? &piece.point_data
                                          : section_ == "Points"  ? &piece.positions
                                          : section_ == "Polys"   ? &piece.polygon_arrays
                                                                  : nullptr;
    if (arrays == nullptr) return;
    if (arrays->size() == kMaxArrays) fail_vtp(path_, "it has too many arrays");
    arrays->push_back(std::move(element));
  }

  std::uint64_t count_of(const VtkArray& element, const char* name) const {
    const std::string text = element.get(name, "0");
    std::uint64_t count = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
    if (error != std::errc() || end != text.data() + text.size())
      fail_vtp(path_, fmt::format("{} is '{}'", name, text.substr(0, 60)));
    return count;
  }

  /// The underscore behind blanks marks where offsets count from.
  void find_data() {
    const std::string_view text(reinterpret_cast<const char*>(bytes_.data()), bytes_.size());
    const std::size_t mark = text.find_first_not_of(" \t\r\n", header_.appended.content);
    if (mark == text.npos || text[mark] != '_')
      fail_vtp(path_, "the appended data do not begin with '_'");
    header_.data = mark + 1;
  }

  const std::string& path_;
  std::span<const std::byte> bytes_;
  std::unique_ptr<XML_ParserStruct, Free> parser_;
  std::exception_ptr failure_;
  bool done_ = false;
  std::string section_;
  VtpHeader header_;
};

}  // namespace

std::string VtkArray::get(const char* name, const char* fallback) const {
  const auto at = attributes.find(name);
  return at == attributes.end() ? fallback : at->second;
}

void fail_vtp(const std::string& path, const std::string& what) {
  throw Error(fmt::format("'{}' is no VTK PolyData file that can be drawn: {}", path, what));
}

VtpHeader parse_vtp_header(const std::string& path, std::span<const std::byte> bytes) {
  return Parser(path, bytes).parse();
}

}  // namespace isobrick

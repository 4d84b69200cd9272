#include "io/vtk/vtk_xml.h"

#include <expat.h>
#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kPiece = std::size_t{1} << 16;
/// The longest tag: hostile files must not fill the memory.
constexpr std::uint64_t kMaxToken = std::uint64_t{1} << 20;

}  // namespace

void VtkXml::ParserDeleter::operator()(XML_ParserStruct* parser) const { XML_ParserFree(parser); }

VtkXml::VtkXml(const VtkFile& file, std::initializer_list<std::string_view> types)
    : file_(file), types_(types), parser_(XML_ParserCreate(nullptr)) {
  XML_SetUserData(parser_.get(), this);
  XML_SetElementHandler(parser_.get(), on_start, on_end);
  XML_SetStartDoctypeDeclHandler(parser_.get(), on_doctype);
}

VtkXml::~VtkXml() = default;

bool VtkXml::parse() {
  const std::unique_ptr<ByteStream> text = file_.open(0);
  std::vector<std::byte> buffer(kPiece);
  for (std::uint64_t done = 0; !stopped_;) {
    const std::size_t size = text->read(buffer.data(), kPiece);
    const auto status = XML_Parse(parser_.get(), reinterpret_cast<const char*>(buffer.data()),
                                  static_cast<int>(size), size == 0);
    if (failure_) std::rethrow_exception(failure_);
    if (stopped_) break;
    if (status != XML_STATUS_OK)
      file_.fail(fmt::format("not XML at byte {}: {}", position(),
                             XML_ErrorString(XML_GetErrorCode(parser_.get()))));
    if (size == 0) return false;
    done += size;
    if (done > position() + kMaxToken)
      file_.fail(
          fmt::format("the XML has no end of an element or a name for {} bytes from byte {} on",
                      kMaxToken, position()));
  }
  return true;
}

std::uint64_t VtkXml::position() const {
  return static_cast<std::uint64_t>(std::max<XML_Index>(XML_GetCurrentByteIndex(parser_.get()), 0));
}

/// Exceptions must not pass through expat.
template <class F>
void VtkXml::guard(void* self, F&& f) {
  VtkXml& xml = *static_cast<VtkXml*>(self);
  if (xml.failure_ || xml.stopped_) return;
  try {
    f(xml);
  } catch (...) {
    xml.failure_ = std::current_exception();
  }
  if (xml.failure_ || xml.stopped_) XML_StopParser(xml.parser_.get(), XML_FALSE);
}

void VtkXml::on_start(void* self, const char* name, const char** attributes) {
  guard(self, [&](VtkXml& xml) {
    const int tag = XML_GetCurrentByteCount(xml.parser_.get());
    VtkElement element{.content = xml.position() + static_cast<std::uint64_t>(tag)};
    for (; *attributes != nullptr; attributes += 2)
      element.attributes[attributes[0]] = attributes[1];
    xml.start_element(name, std::move(element));
  });
}

void VtkXml::on_end(void* self, const char* name) {
  guard(self, [&](VtkXml& xml) { xml.end(name); });
}

void VtkXml::on_doctype(void* self, const char*, const char*, const char*, int) {
  guard(self, [](VtkXml& xml) { xml.file_.fail("a DOCTYPE has no place here"); });
}

void VtkXml::start_element(const std::string& name, VtkElement element) {
  if (header_.file.empty()) {
    const std::string type = element.get("type");
    if (name != "VTKFile" || std::ranges::find(types_, type) == types_.end())
      file_.fail(fmt::format("the XML is a {} of type '{}', not a VTKFile of {}",
                             name.substr(0, 60), type.substr(0, 60), types_.front()));
    header_.file = std::move(element);
    return;
  }
  if (name == "AppendedData") header_.appended = element;
  start(name, std::move(element));
}

}  // namespace isobrick

#include "io/meshes/readers/vtp_header.h"

#include <fmt/format.h>

#include <charconv>
#include <utility>

#include <isobrick/error.h>
#include "io/meshes/readers/memory_stream.h"
#include "io/vtk/vtk_xml.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kMaxArrays = 10'000, kMaxParts = 1'000'000;

/// Takes the pieces of a mesh and their arrays.
class VtpXml final : public VtkXml {
 public:
  explicit VtpXml(const VtkFile& file) : VtkXml(file, {"PolyData", "PPolyData"}) { parse(); }

  VtpHeader take() {
    vtp_.vtk = std::move(header());
    return std::move(vtp_);
  }

 private:
  void start(const std::string& name, VtkElement element) override {
    if (name == "Piece") {
      add_piece(element);
    } else if (name == "AppendedData") {
      stop();
    } else if (name == "DataArray" || name == "Array") {
      add_array(std::move(element));
    } else if (name == "FieldData" || name == "PointData" || name == "Points" || name == "Polys") {
      section_ = name;
      if (name == "PointData" && !vtp_.pieces.empty()) {
        vtp_.pieces.back().normals = element.get("Normals");
        vtp_.pieces.back().scalars = element.get("Scalars");
      }
    }
  }

  void end(const std::string& name) override {
    if (name == section_) section_.clear();
  }

  void add_piece(const VtkElement& element) {
    if (const std::string source = element.get("Source"); !source.empty()) {
      if (vtp_.sources.size() == kMaxParts) file().fail("it has too many parts");
      vtp_.sources.push_back(source);
      return;
    }
    if (vtp_.pieces.size() == kMaxArrays) file().fail("it has too many pieces");
    vtp_.pieces.push_back({.points = count_of(element, "NumberOfPoints"),
                           .polygons = count_of(element, "NumberOfPolys"),
                           .strips = count_of(element, "NumberOfStrips")});
  }

  void add_array(VtkElement element) {
    if (section_ == "FieldData" && element.get("Name") == "unit") vtp_.unit = element;
    if (vtp_.pieces.empty()) return;
    VtpPiece& piece = vtp_.pieces.back();
    std::vector<VtkElement>* const arrays = section_ == "PointData" ? &piece.point_data
                                            : section_ == "Points"  ? &piece.positions
                                            : section_ == "Polys"   ? &piece.polygon_arrays
                                                                    : nullptr;
    if (arrays == nullptr) return;
    if (arrays->size() == kMaxArrays) file().fail("it has too many arrays");
    arrays->push_back(std::move(element));
  }

  std::uint64_t count_of(const VtkElement& element, const char* name) const {
    const std::string text = element.get(name, "0");
    std::uint64_t count = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
    if (error != std::errc() || end != text.data() + text.size())
      file().fail(fmt::format("{} is '{}'", name, text.substr(0, 60)));
    return count;
  }

  std::string section_;
  VtpHeader vtp_;
};

}  // namespace

void fail_vtp(const std::string& path, const std::string& what) {
  throw Error(fmt::format("'{}' is no VTK PolyData file that can be drawn: {}", path, what));
}

VtkFile vtp_file(const std::string& path, std::span<const std::byte> bytes) {
  const auto open = [path, bytes](std::uint64_t begin) {
    return make_memory_stream(path, bytes.subspan(begin));
  };
  return {path, bytes.size(), open, fail_vtp};
}

VtpHeader parse_vtp_header(const VtkFile& file) { return VtpXml(file).take(); }

}  // namespace isobrick

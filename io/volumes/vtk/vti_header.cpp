#include "io/volumes/vtk/vti_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "io/bytes/file_stream.h"
#include "io/volumes/raw/text_header.h"
#include "io/vtk/vtk_xml.h"

namespace isobrick::inline v0 {
namespace {

/// Takes the elements of an image, until the array of samples can be chosen.
class VtiXml final : public VtkXml {
 public:
  VtiXml(const VtkFile& file, std::string name)
      : VtkXml(file, {"ImageData"}), name_(std::move(name)) {
    if (!parse()) this->file().fail("the XML ends before the array of samples is found");
  }

  using VtkXml::header;
  const VtkElement& image() const { return image_; }
  const VtkElement& piece() const { return piece_; }
  const VtkElement& array() const { return array_->element; }
  bool has_cells() const { return array_->cells; }

 private:
  struct DataArray {
    VtkElement element;
    bool cells = false;
  };

  void start(const std::string& name, VtkElement element) override {
    if (name == "ImageData") {
      image_ = std::move(element);
    } else if (name == "Piece") {
      if (!piece_.empty()) file().fail("images of several pieces are not supported");
      piece_ = std::move(element);
    } else if (name == "PointData" || name == "CellData") {
      section_ = name;
      scalars_[name] = element.get("Scalars");
    } else if (name == "DataArray" && !section_.empty()) {
      start_array(std::move(element));
    } else if (name == "AppendedData") {
      choose_array();
    }
  }

  void start_array(VtkElement element) {
    constexpr std::size_t kMaxArrays = 10000;
    if (arrays_.size() == kMaxArrays) file().fail("there are too many arrays");
    arrays_.push_back({std::move(element), section_ == "CellData"});
  }

  void end(const std::string& name) override {
    if (name == section_) section_.clear();
    // The parser has skipped the text of inline arrays to get here; it is read again.
    if (name == "Piece" && !arrays_.empty() && all_inline()) choose_array();
  }

  bool all_inline() const {
    return std::ranges::none_of(
        arrays_, [](const DataArray& array) { return array.element.get("format") == "appended"; });
  }

  std::string names() const {
    std::string text;
    for (const DataArray& array : arrays_)
      if (const std::string name = array.element.get("Name"); !name.empty())
        text += (text.empty() ? "'" : ", '") + name.substr(0, 60) + "'";
    return text.substr(0, 600);
  }

  /// The array of that name, or the only one where there is no name.
  std::optional<DataArray> find(bool cells, const std::string& name) const {
    std::optional<DataArray> found;
    for (const DataArray& array : arrays_) {
      if (array.cells != cells) continue;
      if (!name.empty() && array.element.get("Name") != name) continue;
      if (found) return std::nullopt;
      found = array;
    }
    return found;
  }

  void choose_array() {
    for (const bool cells : {false, true}) {
      const std::string& scalars = scalars_[cells ? "CellData" : "PointData"];
      if (!array_) array_ = find(cells, name_.empty() ? scalars : name_);
    }
    if (!array_ && arrays_.empty()) file().fail("there is no array of point or cell data");
    if (!array_)
      file().fail(
          name_.empty()
              ? fmt::format("none of its arrays ({}) is marked as the scalars: choose "
                            "one as '{}:/NAME'",
                            names(), file().path)
              : fmt::format("there is no array '{}' among {}", name_.substr(0, 60), names()));
    stop();
  }

  std::string name_, section_;
  VtkElement image_, piece_;
  std::map<std::string, std::string> scalars_;
  std::vector<DataArray> arrays_;
  std::optional<DataArray> array_;
};

std::vector<double> reals(const std::string& path, const VtkElement& element, const char* name,
                          const char* fallback, std::size_t count) {
  std::vector<double> numbers;
  const std::string text = element.get(name, fallback);
  for (const auto word : split_words(text)) numbers.push_back(parse_real(path, name, word));
  if (numbers.size() != count)
    header_error(path, fmt::format("{} has {} numbers, not {}", name, numbers.size(), count));
  return numbers;
}

/// First and one after the last sample, from the text of the attribute `name`.
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
      {"UInt8", ScalarType::u8},   {"Int8", ScalarType::i8},    {"UInt16", ScalarType::u16},
      {"Int16", ScalarType::i16},  {"UInt32", ScalarType::u32}, {"Int32", ScalarType::i32},
      {"UInt64", ScalarType::u64}, {"Int64", ScalarType::i64},  {"Float32", ScalarType::f32},
      {"Float64", ScalarType::f64}};
  for (const auto& [known, type] : types)
    if (name == known) return type;
  header_error(path, fmt::format("samples of type '{}' are not supported", name.substr(0, 60)));
}

Transform read_transform(const std::string& path, const VtkElement& image, Int3 first, bool cells) {
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

}  // namespace

VtkFile vti_file(const std::string& path) {
  const auto open = [path](std::uint64_t begin) {
    return make_file_stream(open_input(path), begin);
  };
  return {path, open_input(path).size(), open, header_error};
}

VtiHeader parse_vti_header(const VtkFile& file, const std::string& array,
                           const Selection& selection) {
  VtiXml xml(file, array);
  const std::string& path = file.path;
  VtiHeader header;
  const std::string whole = xml.image().get("WholeExtent");
  const Box3 box = read_extent(path, "WholeExtent", whole);
  if (!(read_extent(path, "Extent", xml.piece().get("Extent", whole.c_str())) == box))
    header_error(path, "the piece is not the whole extent, which is not supported");
  const Int3 extent = xml.has_cells() ? box.extent() - Int3{1, 1, 1} : box.extent();
  const Index components =
      parse_integer(path, "NumberOfComponents", xml.array().get("NumberOfComponents", "1"));
  const ArrayAxis axes[] = {{components, AxisRole::channel},
                            {extent.x, AxisRole::space},
                            {extent.y, AxisRole::space},
                            {extent.z, AxisRole::space}};
  header.view = select_volume(path, axes, selection);
  header.transform = read_transform(path, xml.image(), box.lo, xml.has_cells());
  header.type = read_type(path, xml.array().get("type"));
  header.array = vtk_array_layout(file, xml.header(), xml.array());
  return header;
}

}  // namespace isobrick

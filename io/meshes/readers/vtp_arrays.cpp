#include "io/meshes/readers/vtp_arrays.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include <isobrick/scalar.h>
#include "io/meshes/readers/scratch_rows.h"
#include "io/vtk/vtk_arrays.h"

namespace isobrick::inline v0 {
namespace {

/// A kind of numbers by VTK's name, and the type that their text becomes: doubles hold the whole
/// numbers that count vertices.
struct NamedKind {
  std::string_view name;
  NumberKind kind;
  ScalarType type_of_text;
  NumberKind kind_of_text;
};

constexpr NamedKind kKinds[] = {
    {"Int8", NumberKind::i8, ScalarType::i8, NumberKind::i8},
    {"UInt8", NumberKind::u8, ScalarType::u8, NumberKind::u8},
    {"Int16", NumberKind::i16, ScalarType::i16, NumberKind::i16},
    {"UInt16", NumberKind::u16, ScalarType::u16, NumberKind::u16},
    {"Int32", NumberKind::i32, ScalarType::i32, NumberKind::i32},
    {"UInt32", NumberKind::u32, ScalarType::u32, NumberKind::u32},
    {"Int64", NumberKind::i64, ScalarType::f64, NumberKind::f64},
    {"UInt64", NumberKind::u64, ScalarType::f64, NumberKind::f64},
    {"Float32", NumberKind::f32, ScalarType::f32, NumberKind::f32},
    {"Float64", NumberKind::f64, ScalarType::f64, NumberKind::f64},
};

/// The next bytes of an array, or none at their end.
std::size_t read_part(VtkNumbers& numbers, std::span<std::byte> out) {
  const std::size_t count = numbers.stream->read(
      out.data(), static_cast<std::size_t>(std::min<std::uint64_t>(out.size(), numbers.bytes)));
  numbers.bytes -= count;
  return count;
}

}  // namespace

NumberArray VtpArrays::numbers(const VtkElement& array) const {
  const std::string type = array.get("type");
  const auto* const kind = std::find_if(std::begin(kKinds), std::end(kKinds),
                                        [&](const NamedKind& known) { return known.name == type; });
  if (kind == std::end(kKinds)) file_.fail(fmt::format("an array is of '{}'", type.substr(0, 60)));
  const VtkArrayLayout layout = vtk_array_layout(file_, header_, array);
  VtkNumbers content = open_vtk_array(file_, layout, kind->type_of_text);
  std::span<const std::byte> bytes;
  if (layout.plain()) {
    bytes = bytes_.subspan(layout.first_number(), content.bytes);
  } else {
    ScratchBytes scratch;
    std::vector<std::byte> piece(std::size_t{1} << 16);
    while (const std::size_t count = read_part(content, piece))
      scratch.append({piece.data(), count});
    const std::shared_ptr<MappedFile> mapped = scratch.map();
    keep_.push_back(mapped);
    bytes = mapped->bytes();
  }
  const bool text = layout.encoding == VtkEncoding::ascii;
  NumberArray numbers{.first = bytes.data(),
                      .kind = text ? kind->kind_of_text : kind->kind,
                      .swapped = layout.swap};
  numbers.count = bytes.size() / size_of(numbers.kind);
  return numbers;
}

std::string VtpArrays::text(const VtkElement& array, std::size_t max) const {
  const VtkArrayLayout layout = vtk_array_layout(file_, header_, array);
  VtkNumbers content = open_vtk_array(file_, layout, ScalarType::u8);
  std::string text(max, '\0');
  text.resize(read_part(content, std::as_writable_bytes(std::span(text))));
  return text.substr(0, text.find('\0'));
}

}  // namespace isobrick

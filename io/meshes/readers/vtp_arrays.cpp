#include "io/meshes/readers/vtp_arrays.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <string_view>
#include <utility>

#include <isobrick/scalar.h>
#include "io/bytes/base64_stream.h"
#include "io/bytes/byte_order.h"
#include "io/bytes/text_stream.h"
#include "io/bytes/zlib_block_stream.h"
#include "io/meshes/readers/memory_stream.h"
#include "io/meshes/readers/scratch_rows.h"

namespace isobrick {
namespace {

/// A kind of numbers by VTK's name, and what text of them is read as: doubles hold the whole
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

}  // namespace

std::size_t VtpArrays::size_bytes() const {
  return header_.file.get("header_type", "UInt32") == "UInt64" ? 8 : 4;
}

std::uint64_t VtpArrays::read_size(ByteStream& stream) const {
  std::byte raw[8]{};
  stream.read_exactly(raw, size_bytes());
  if (header_.swapped()) swap_byte_order(raw, 1, size_bytes());
  std::uint64_t size = 0;
  std::memcpy(&size, raw, size_bytes());
  return size;
}

/// From the array's first byte or character to the end of the file.
std::span<const std::byte> VtpArrays::encoded(const VtkArray& array) const {
  if (array.get("format", "ascii") != "appended") {
    const auto rest = bytes_.subspan(std::min<std::size_t>(array.content, bytes_.size()));
    // VTK indents the text, and the table of zlib blocks is counted in characters.
    const auto first = std::ranges::find_if_not(rest, [](std::byte b) {
      return b == std::byte{' '} || (b >= std::byte{'\t'} && b <= std::byte{'\r'});
    });
    return rest.subspan(static_cast<std::size_t>(first - rest.begin()));
  }
  const std::string text = array.get("offset", "0");
  std::uint64_t offset = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), offset);
  if (error != std::errc() || end != text.data() + text.size() || header_.data == 0 ||
      offset > bytes_.size() - header_.data)
    fail_vtp(path_, fmt::format("the array '{}' is at offset '{}'", array.get("Name"),
                                text.substr(0, 60)));
  return bytes_.subspan(header_.data + offset);
}

/// The zlib blocks behind their table, unpacked.
std::unique_ptr<ByteStream> VtpArrays::unpacked(std::span<const std::byte> encoded,
                                                bool base64) const {
  const auto open = [&](std::uint64_t from) {
    if (from > encoded.size()) fail_vtp(path_, "it ends within an array");
    auto stream = make_memory_stream(path_, encoded.subspan(from));
    return base64 ? make_base64_stream(std::move(stream)) : std::move(stream);
  };
  auto sizes = open(0);
  BlockTable table;
  table.blocks = read_size(*sizes);
  table.block_bytes = read_size(*sizes);
  table.last_bytes = read_size(*sizes);
  table.entry_bytes = static_cast<int>(size_bytes());
  table.swap = header_.swapped();
  if (table.blocks > encoded.size()) fail_vtp(path_, "it ends within an array");
  // The table is encoded by itself, before the blocks.
  const std::uint64_t bytes = (3 + table.blocks) * size_bytes();
  return make_zlib_block_stream(table, std::move(sizes),
                                open(base64 ? (bytes + 2) / 3 * 4 : bytes));
}

std::size_t VtpArrays::Content::read(std::span<std::byte> out) {
  const std::size_t count =
      bytes->read(out.data(), static_cast<std::size_t>(std::min<std::uint64_t>(out.size(), size)));
  size -= count;
  return count;
}

VtpArrays::Content VtpArrays::open(const VtkArray& array, ScalarType type_of_text) const {
  const std::string format = array.get("format", "ascii");
  const std::span<const std::byte> from = encoded(array);
  if (format == "ascii")
    return {.bytes = make_text_stream(make_element_stream(make_memory_stream(path_, from)),
                                      type_of_text),
            .native = true};
  if (format != "binary" && format != "appended")
    fail_vtp(path_, fmt::format("an array has the format '{}'", format.substr(0, 60)));
  const bool base64 = format == "binary" || header_.appended.get("encoding", "raw") == "base64";
  if (const std::string compressor = header_.file.get("compressor"); !compressor.empty()) {
    if (compressor != "vtkZLibDataCompressor")
      fail_vtp(path_, fmt::format("compression by {} is not read, only by vtkZLibDataCompressor",
                                  compressor.substr(0, 60)));
    return {.bytes = unpacked(from, base64)};
  }
  auto stream = make_memory_stream(path_, from);
  if (base64) stream = make_base64_stream(std::move(stream));
  const std::uint64_t size = read_size(*stream);
  if (size > from.size()) fail_vtp(path_, "it ends within an array");
  if (base64) return {.bytes = std::move(stream), .size = size};
  if (size > from.size() - size_bytes()) fail_vtp(path_, "it ends within an array");
  return {.in_place = from.subspan(size_bytes(), size)};
}

NumberArray VtpArrays::numbers(const VtkArray& array) const {
  const std::string type = array.get("type");
  const auto* const kind = std::find_if(std::begin(kKinds), std::end(kKinds),
                                        [&](const NamedKind& known) { return known.name == type; });
  if (kind == std::end(kKinds))
    fail_vtp(path_, fmt::format("an array is of '{}'", type.substr(0, 60)));
  Content content = open(array, kind->type_of_text);
  if (content.bytes) {
    ScratchBytes scratch;
    std::vector<std::byte> piece(std::size_t{1} << 16);
    while (const std::size_t count = content.read(piece)) scratch.append({piece.data(), count});
    const std::shared_ptr<MappedFile> mapped = scratch.map();
    keep_.push_back(mapped);
    content.in_place = mapped->bytes();
  }
  NumberArray numbers{.first = content.in_place.data(),
                      .kind = content.native ? kind->kind_of_text : kind->kind,
                      .swapped = !content.native && header_.swapped()};
  numbers.count = content.in_place.size() / size_of(numbers.kind);
  return numbers;
}

std::string VtpArrays::text(const VtkArray& array, std::size_t most) const {
  Content content = open(array, ScalarType::u8);
  std::string text(most, '\0');
  if (content.bytes) {
    text.resize(content.read(std::as_writable_bytes(std::span(text))));
  } else {
    text.assign(reinterpret_cast<const char*>(content.in_place.data()),
                std::min(most, content.in_place.size()));
  }
  return text.substr(0, text.find('\0'));
}

}  // namespace isobrick

#include "io/vtk/vtk_arrays.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <string_view>
#include <utility>

#include "io/bytes/base64_stream.h"
#include "io/bytes/text_stream.h"
#include "io/bytes/zlib_block_stream.h"

namespace isobrick::inline v0 {
namespace {

std::unique_ptr<ByteStream> open_at(const VtkFile& file, std::uint64_t begin) {
  if (begin > file.bytes) file.fail("it ends within an array");
  return file.open(begin);
}

/// The first character at or after `begin` that is no blank: VTK indents text and base64, and the
/// table of zlib blocks is counted in characters.
std::uint64_t after_blanks(const VtkFile& file, std::uint64_t begin) {
  constexpr std::size_t kMaxBlanks = 4096;
  char text[kMaxBlanks];
  const auto stream = open_at(file, begin);
  const std::size_t size = stream->read(reinterpret_cast<std::byte*>(text), kMaxBlanks);
  const std::size_t blanks = std::string_view(text, size).find_first_not_of(" \t\n\v\f\r");
  return begin + std::min(blanks, size);
}

/// Where the offsets of appended arrays count from: the underscore before them.
std::uint64_t appended_begin(const VtkFile& file, const VtkElement& appended) {
  if (appended.content == 0) file.fail("it has no appended data");
  const std::uint64_t mark = after_blanks(file, appended.content);
  std::byte first{};
  if (open_at(file, mark)->read(&first, 1) == 0 || first != std::byte{'_'})
    file.fail("the appended data do not begin with '_'");
  return mark + 1;
}

std::uint64_t offset_of(const VtkFile& file, const VtkElement& array, std::uint64_t data) {
  const std::string text = array.get("offset", "0");
  std::uint64_t offset = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), offset);
  if (error != std::errc() || end != text.data() + text.size() || offset > file.bytes - data)
    file.fail(fmt::format("the offset '{}' of the array '{}' is no place in the file",
                          text.substr(0, 60), array.get("Name").substr(0, 60)));
  return offset;
}

/// The array's bytes, `from` characters after its beginning.
std::unique_ptr<ByteStream> open_encoded(const VtkFile& file, const VtkArrayLayout& layout,
                                         std::uint64_t from) {
  auto stream = open_at(file, layout.begin + from);
  return layout.encoding == VtkEncoding::base64 ? make_base64_stream(std::move(stream))
                                                : std::move(stream);
}

std::uint64_t read_size(ByteStream& stream, const VtkArrayLayout& layout) {
  return stream.read_unsigned(static_cast<std::size_t>(layout.size_bytes), layout.swap);
}

/// The most bytes that can follow the size of an array.
std::uint64_t stored_bytes(const VtkFile& file, const VtkArrayLayout& layout) {
  const std::uint64_t rest = file.bytes - layout.begin;
  const std::uint64_t bytes = layout.encoding == VtkEncoding::base64 ? rest / 4 * 3 : rest;
  return bytes - std::min(bytes, static_cast<std::uint64_t>(layout.size_bytes));
}

/// The zlib blocks behind their table, which is encoded by itself.
std::unique_ptr<ByteStream> open_compressed(const VtkFile& file, const VtkArrayLayout& layout) {
  auto sizes = open_encoded(file, layout, 0);
  BlockTable table;
  table.blocks = read_size(*sizes, layout);
  table.block_bytes = read_size(*sizes, layout);
  table.last_bytes = read_size(*sizes, layout);
  table.entry_bytes = layout.size_bytes;
  table.swap = layout.swap;
  if (table.blocks > file.bytes) file.fail("it ends within an array");
  const std::uint64_t bytes = (3 + table.blocks) * static_cast<std::uint64_t>(layout.size_bytes);
  const std::uint64_t characters =
      layout.encoding == VtkEncoding::base64 ? (bytes + 2) / 3 * 4 : bytes;
  return make_zlib_block_stream(table, std::move(sizes), open_encoded(file, layout, characters));
}

}  // namespace

VtkArrayLayout vtk_array_layout(const VtkFile& file, const VtkHeader& header,
                                const VtkElement& array) {
  VtkArrayLayout layout;
  const std::string size_type = header.file.get("header_type", "UInt32");
  if (size_type != "UInt32" && size_type != "UInt64")
    file.fail(fmt::format("header_type '{}' is not known", size_type.substr(0, 60)));
  layout.size_bytes = size_type == "UInt64" ? 8 : 4;
  const std::string format = array.get("format", "ascii");
  if (format == "appended") {
    const bool base64 = header.appended.get("encoding", "raw") == "base64";
    layout.encoding = base64 ? VtkEncoding::base64 : VtkEncoding::raw;
    const std::uint64_t data = appended_begin(file, header.appended);
    layout.begin = data + offset_of(file, array, data);
  } else if (format == "ascii" || format == "binary") {
    layout.encoding = format == "ascii" ? VtkEncoding::ascii : VtkEncoding::base64;
    layout.begin = after_blanks(file, array.content);
  } else {
    file.fail(fmt::format("the format '{}' is not known", format.substr(0, 60)));
  }
  if (layout.encoding == VtkEncoding::ascii) return layout;
  const bool big = header.file.get("byte_order", "LittleEndian") == "BigEndian";
  layout.swap = big != (std::endian::native == std::endian::big);
  const std::string compressor = header.file.get("compressor");
  layout.compressed = !compressor.empty();
  if (layout.compressed && compressor != "vtkZLibDataCompressor")
    file.fail(fmt::format("compression by {} is not supported, only vtkZLibDataCompressor",
                          compressor.substr(0, 60)));
  return layout;
}

VtkNumbers open_vtk_array(const VtkFile& file, const VtkArrayLayout& layout, ScalarType type) {
  if (layout.encoding == VtkEncoding::ascii) {
    auto text = open_at(file, layout.begin);
    return {.stream = make_text_stream(make_element_stream(std::move(text)), type)};
  }
  if (layout.compressed) return {.stream = open_compressed(file, layout)};
  auto stream = open_encoded(file, layout, 0);
  const std::uint64_t bytes = read_size(*stream, layout);
  if (bytes > stored_bytes(file, layout))
    file.fail(
        fmt::format("an array states {} bytes, more than the file has after it; check byte_order "
                    "and header_type",
                    bytes));
  return {std::move(stream), bytes};
}

}  // namespace isobrick

#include "io/volumes/vtk/vti_volume.h"

#include <fmt/format.h>

#include <limits>
#include <utility>

#include <isobrick/error.h>
#include "io/bytes/base64_stream.h"
#include "io/bytes/file_stream.h"
#include "io/bytes/text_stream.h"
#include "io/bytes/zlib_block_stream.h"
#include "io/volumes/raw/raw_source.h"
#include "io/volumes/stream_source.h"
#include "io/volumes/vtk/vti_header.h"

namespace isobrick {
namespace {

bool must_swap(const VtiHeader& header) { return header.order != kNativeOrder; }

/// The array's bytes as the encoding leaves them, `from` characters after its
/// beginning.
std::unique_ptr<ByteStream> open_encoded(const std::string& path, const VtiHeader& header,
                                         std::uint64_t from) {
  File file = open_input(path);
  const std::uint64_t end = file.size();
  if (header.begin > end || from > end - header.begin)
    throw UsageError(fmt::format("'{}' ends before its array of samples", path));
  auto stream = make_file_stream(std::move(file), header.begin + from);
  return header.encoding == VtiEncoding::base64 ? make_base64_stream(std::move(stream))
                                                : std::move(stream);
}

/// The next number of the kind that says how long something is.
std::uint64_t read_size(ByteStream& stream, const VtiHeader& header) {
  return stream.read_unsigned(static_cast<std::size_t>(header.size_bytes), must_swap(header));
}

std::unique_ptr<ByteStream> open_compressed(const std::string& path, const VtiHeader& header) {
  auto sizes = open_encoded(path, header, 0);
  BlockTable table;
  table.blocks = read_size(*sizes, header);
  table.block_bytes = read_size(*sizes, header);
  table.last_bytes = read_size(*sizes, header);
  table.entry_bytes = header.size_bytes;
  table.swap = must_swap(header);
  const auto entry = static_cast<std::uint64_t>(header.size_bytes);
  if (table.blocks > std::numeric_limits<std::uint64_t>::max() / 64)
    throw UsageError(fmt::format("'{}' cannot have {} compressed blocks", path, table.blocks));
  // The table is encoded by itself, before the blocks.
  const std::uint64_t bytes = (3 + table.blocks) * entry;
  const std::uint64_t characters =
      header.encoding == VtiEncoding::base64 ? (bytes + 2) / 3 * 4 : bytes;
  return make_zlib_block_stream(table, std::move(sizes), open_encoded(path, header, characters));
}

std::unique_ptr<ByteStream> open_array(const std::string& path, const VtiHeader& header,
                                       std::uint64_t expected) {
  if (header.encoding == VtiEncoding::ascii) {
    auto text = make_file_stream(open_input(path), header.begin);
    return make_text_stream(make_element_stream(std::move(text)), header.type);
  }
  if (header.compressed) return open_compressed(path, header);
  auto stream = open_encoded(path, header, 0);
  if (const std::uint64_t size = read_size(*stream, header); size != expected)
    throw UsageError(
        fmt::format("'{}': the array has {} bytes, but its extent makes {}", path, size, expected));
  return stream;
}

}  // namespace

std::unique_ptr<VolumeSource> open_vti(const std::string& path, const std::string& array,
                                       const VolumeRequest& said) {
  refuse_raw_description(path, "a VTK image", said);
  const VtiHeader header = parse_vti_header(path, array, said.selection);
  const std::size_t sample = size_of(header.type);
  SampleLayout layout;
  layout.info = describe_volume(path, header.view.extent, header.type, header.transform, said);
  layout.offset = static_cast<std::uint64_t>(header.view.first) * sample;
  layout.stride = header.view.stride;
  layout.swap = sample > 1 && header.encoding != VtiEncoding::ascii && must_swap(header);
  const std::uint64_t total = static_cast<std::uint64_t>(header.view.total) * sample;
  auto stream = open_array(path, header, total);
  if (header.encoding != VtiEncoding::raw || header.compressed)
    return make_stream_source(std::move(layout), std::move(stream), total,
                              header.encoding == VtiEncoding::base64 && !header.compressed
                                  ? AfterEnd::unread
                                  : AfterEnd::refused);
  layout.offset += header.begin + static_cast<std::uint64_t>(header.size_bytes);
  File file = open_input(path);
  check_header_promise(layout, file);
  return make_raw_source(std::move(layout), std::move(file));
}

}  // namespace isobrick

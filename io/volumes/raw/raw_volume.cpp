#include "io/volumes/raw/raw_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <string_view>
#include <utility>

#include <isobrick/error.h>
#include "io/bytes/concat_stream.h"
#include "io/bytes/file.h"
#include "io/bytes/file_stream.h"
#include "io/bytes/inflate_stream.h"
#include "io/bytes/text_stream.h"
#include "io/volumes/raw/meta_image_header.h"
#include "io/volumes/raw/nifti_volume.h"
#include "io/volumes/raw/nrrd_header.h"
#include "io/volumes/raw/raw_name.h"
#include "io/volumes/raw/raw_source.h"
#include "io/volumes/stream_source.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// The header beside a raw file, if there is one and it means this very file.
std::optional<TextHeader> find_header_beside(const std::string& path,
                                             const VolumeRequest& request) {
  for (const char* extension : {".nhdr", ".mhd"}) {
    const std::string candidate = fs::path(path).replace_extension(extension).string();
    std::error_code error;
    if (!fs::is_regular_file(candidate, error)) continue;
    try {
      auto header = parse_text_header(candidate, extension[1] == 'n', request.selection);
      if (header.data_paths.size() == 1 && fs::equivalent(header.data_paths[0], path, error))
        return header;
    } catch (const UsageError&) {
      // A complete request does not need the header.
      if (!request.extent || !request.type) throw;
    }
  }
  return std::nullopt;
}

std::string describe(Int3 extent, ScalarType type) {
  return fmt::format("{}x{}x{} {}", extent.x, extent.y, extent.z, short_name(type));
}

bool must_swap(std::optional<ByteOrder> order, ScalarType type) {
  return order && *order != kNativeOrder && size_of(type) > 1;
}

/// The requested order, else the header's, which may not be missing where it matters.
std::optional<ByteOrder> order_of(const TextHeader& header, ScalarType type,
                                  const VolumeRequest& request) {
  const auto order = request.order ? request.order : header.order;
  if (!order && size_of(type) > 1) header_error(header.path, "the field 'endian' is missing");
  return order;
}

/// The end of the text lines that a NRRD header skips.
std::uint64_t after_lines(const File& file, const std::string& path, std::uint64_t begin,
                          std::uint64_t lines) {
  if (lines == 0) return begin;
  const std::string text = file.text_at(begin, kMaxHeader);
  std::size_t at = 0;
  for (std::uint64_t i = 0; i < lines; ++i) {
    at = text.find('\n', at);
    if (at == std::string::npos)
      throw UsageError(fmt::format("'{}' has only {} of the {} lines to skip in its first {} bytes",
                                   path, i, lines, text.size()));
    ++at;
  }
  return begin + at;
}

/// What describes a file's samples: the header in it or beside it, or its name and options.
enum class DescribedBy : std::uint8_t { header, caller };

/// The types of which so many samples would make the file's size, as "u16 or i16".
std::string types_that_fit(std::uint64_t count, std::uint64_t bytes) {
  std::string types;
  for (const ScalarType type : kScalarTypes)
    if (count * size_of(type) == bytes)
      types += fmt::format("{}{}", types.empty() ? "" : " or ", short_name(type));
  return types;
}

/// What else would make the size right, as " (would fit …)". Where a header states the offset,
/// another one would only shift the samples.
std::string size_hint(DescribedBy by, const std::string& types, std::uint64_t samples,
                      std::uint64_t size) {
  const bool header = by == DescribedBy::header;
  if (!types.empty())
    return fmt::format(" (would fit {} {})", header ? "the type" : "--type", types);
  constexpr std::uint64_t likely_header = 64 * 1024;
  if (!header && size >= samples && size - samples <= likely_header)
    return fmt::format(" (would fit --offset {})", size - samples);
  return {};
}

/// The file must hold `samples` bytes from the layout's offset on. What follows them is left to
/// trailing_note() where a header describes them, unless samples of another type would fit.
void check_size(const TextHeader& header, DescribedBy by, const VolumeInfo& info,
                std::uint64_t offset, std::uint64_t samples, std::uint64_t size) {
  if (offset <= size && size - offset == samples) return;
  const std::string types =
      size > offset ? types_that_fit(samples / size_of(info.type), size - offset) : "";
  if (by == DescribedBy::header && offset <= size && size - offset > samples && types.empty())
    return;
  const std::string at = offset ? fmt::format(" after offset {}", offset) : "";
  const bool whole =
      samples == static_cast<std::uint64_t>(volume(info.extent)) * size_of(info.type);
  const bool apart = header.path != header.data_paths[0];
  throw UsageError(fmt::format("'{}' has {} bytes, but {} samples{}{}{} make {}{}", info.name, size,
                               describe(info.extent, info.type),
                               apart ? fmt::format(" as '{}' has them", header.path) : "",
                               whole ? "" : " of each channel and time", at,
                               // Only in words if the sum would wrap around.
                               offset > std::numeric_limits<std::uint64_t>::max() - samples
                                   ? std::string("far more")
                                   : fmt::format("{}", offset + samples),
                               size_hint(by, types, samples, size)));
}

/// Takes a header's description of the OpenVDB grid that its samples were.
void take_grid(const TextHeader& header, VolumeInfo& info) {
  info.grid_class = header.grid_class;
  info.grid_name = header.grid_name;
  info.labels = header.labels;
  if (header.fill_value && info.type == header.type) info.fill_value = *header.fill_value;
}

std::vector<fs::path> files_of(const TextHeader& header) {
  std::vector<fs::path> files(header.data_paths.begin(), header.data_paths.end());
  files.emplace_back(header.path);
  return files;
}

/// Opens samples that lie as they are in one file. The request overrides the header.
std::unique_ptr<VolumeSource> open_described(const TextHeader& header, const VolumeRequest& request,
                                             DescribedBy by, File file) {
  const std::string& path = header.data_paths[0];
  if (request.extent || request.type || request.offset) by = DescribedBy::caller;
  const ScalarType type = request.type.value_or(header.type);
  SampleLayout layout;
  layout.info = describe_volume(path, request.extent.value_or(header.view.extent), type,
                                header.transform, request);
  take_grid(header, layout.info);
  layout.info.files = files_of(header);
  layout.swap = must_swap(order_of(header, type, request), type);
  const auto total =
      static_cast<std::uint64_t>(request.extent ? volume(*request.extent) : header.view.total) *
      size_of(type);
  const std::uint64_t size = file.size();
  std::uint64_t offset = header.data_begin;
  if (request.offset)
    offset = *request.offset;
  else if (header.data_at_end)
    offset = std::max(offset, size > total ? size - total : 0);
  else
    offset = after_lines(file, path, header.data_begin, header.skip_lines) + header.skip_bytes;
  check_size(header, by, layout.info, offset, total, size);
  if (const std::uint64_t extra = size - offset - total; extra > 0)
    layout.notes.push_back(trailing_note(quoted(file.path()), extra));
  layout.offset = offset;
  if (!request.extent) {
    layout.offset += static_cast<std::uint64_t>(header.view.first) * size_of(type);
    layout.stride = header.view.stride;
  }
  return make_raw_source(std::move(layout), std::move(file));
}

/// The bytes of one data file, from where its samples begin.
std::unique_ptr<ByteStream> open_bytes(const TextHeader& header, const std::string& path) {
  File file = open_data_file(path, header.path);
  const std::uint64_t begin = after_lines(file, path, header.data_begin, header.skip_lines);
  const std::uint64_t end = file.size();
  const bool packed = header.encoding == Encoding::gzip || header.encoding == Encoding::zlib;
  if (packed && begin == end) header_error(header.path, "no samples follow");
  std::byte first{};
  if (packed) file.read_at(begin, {&first, 1});
  const std::uint64_t skip = packed ? 0 : header.skip_bytes;
  if (begin > end || end - begin < skip)
    header_error(header.path,
                 fmt::format("'{}' has {} bytes, fewer than are to be skipped", path, end));
  auto stream = make_file_stream(std::move(file), begin + skip);
  if (!packed) return stream;
  // MetaImage's writers have wrapped deflated data either way.
  constexpr std::byte kGzip{0x1f};
  stream = make_inflate_stream(std::move(stream), first == kGzip ? Wrapper::gzip : Wrapper::zlib);
  if (header.skip_bytes > stream->max_bytes())
    header_error(header.path,
                 fmt::format("'{}' cannot have {} bytes to skip", path, header.skip_bytes));
  stream->skip(header.skip_bytes);
  return stream;
}

/// The samples of one data file. Each is a text of its own: a number ends with its file.
std::unique_ptr<ByteStream> open_data(const TextHeader& header, const std::string& path) {
  auto bytes = open_bytes(header, path);
  if (header.encoding != Encoding::text) return bytes;
  return make_text_stream(std::move(bytes), header.type);
}

std::unique_ptr<ByteStream> open_all_data(const TextHeader& header) {
  if (header.data_paths.size() == 1) return open_data(header, header.data_paths[0]);
  return make_concat_stream(
      "the data files of '" + header.path + "'", header.data_paths.size(),
      [header](std::size_t i) { return open_data(header, header.data_paths[i]); });
}

}  // namespace

TextHeader parse_text_header(const std::string& path, bool nrrd, const Selection& selection) {
  return nrrd ? parse_nrrd_header(path, selection) : parse_meta_image_header(path, selection);
}

std::unique_ptr<VolumeSource> open_text_volume(const TextHeader& header,
                                               const VolumeRequest& request) {
  if (header.encoding == Encoding::raw && header.data_paths.size() == 1)
    return open_described(header, request, DescribedBy::header,
                          open_data_file(header.data_paths[0], header.path));
  VolumeRequest rest = request;
  rest.order.reset();
  refuse_raw_description(header.path, "a header that describes its samples", rest);
  if (header.data_at_end)
    header_error(header.path, "samples at the end of a file must be raw and in one file");
  const ScalarType type = header.type;
  SampleLayout layout;
  layout.info = describe_volume(header.path, header.view.extent, type, header.transform, request);
  take_grid(header, layout.info);
  layout.info.files = files_of(header);
  const std::size_t sample = size_of(type);
  layout.offset = static_cast<std::uint64_t>(header.view.first) * sample;
  layout.stride = header.view.stride;
  if (!header.attached()) layout.header = header.path;
  const std::uint64_t end = static_cast<std::uint64_t>(header.view.total) * sample;
  auto stream = open_all_data(header);
  if (header.encoding != Encoding::text)
    layout.swap = must_swap(order_of(header, type, request), type);
  // More files than the header's extent needs are a mistake in it.
  const AfterEnd after_end = header.data_paths.size() > 1        ? AfterEnd::refused
                             : header.encoding == Encoding::text ? AfterEnd::noted_as_numbers
                                                                 : AfterEnd::noted;
  return make_stream_source(std::move(layout), std::move(stream), end, after_end);
}

namespace {

constexpr const char* kStdinName = "standard input";

/// Throws the UsageError of samples whose extent or type is not known, with what to add.
[[noreturn]] void refuse_unknown(const std::string& path, bool extent, bool type) {
  const bool is_file = path != kStdinName;
  throw UsageError(fmt::format(
      "the {} of {} {} not known: add {}{}{}{}",
      extent ? "type"
      : type ? "extent"
             : "extent and type",
      is_file ? fmt::format("'{}'", path) : path, extent || type ? "is" : "are",
      extent ? "" : "--dims X,Y,Z", extent || type ? "" : " ", type ? "" : "--type TYPE",
      !is_file
          ? ""
          : ", name the file like 'scan_256x256x128_uint8.raw', or give a .nhdr or .mhd header" +
                nifti_pair_hint(path)));
}

/// Extent and type of the request, else those in the name.
TextHeader describe_by_name(const std::string& path, const VolumeRequest& request) {
  const RawName name = parse_raw_name(fs::path(path).stem().string());
  const auto extent = request.extent ? request.extent : name.extent;
  const auto type = request.type ? request.type : name.type;
  if (!extent || !type) refuse_unknown(path, extent.has_value(), type.has_value());
  refuse_selection(path, request);
  TextHeader header;
  header.path = path;
  header.data_paths = {path};
  header.type = *type;
  header.order = ByteOrder::little;
  const VolumeInfo checked = describe_volume(path, *extent, *type, {}, request);
  header.view = {checked.extent, {1, extent->x, extent->x * extent->y}, 0, volume(checked.extent)};
  return header;
}

}  // namespace

std::unique_ptr<VolumeSource> open_raw(const std::string& path, const VolumeRequest& request) {
  File file = open_input(path);
  if (const auto header = find_header_beside(path, request))
    return open_text_volume(*header, request);
  return open_described(describe_by_name(path, request), request, DescribedBy::caller,
                        std::move(file));
}

std::unique_ptr<VolumeSource> open_stdin(const VolumeRequest& request) {
  const std::string name = kStdinName;
  const TextHeader header = describe_by_name(name, request);
  const std::uint64_t offset = request.offset.value_or(0);
  if (offset > std::numeric_limits<std::uint64_t>::max() / 2)
    throw UsageError(fmt::format("an offset of {} bytes is too large", offset));
  SampleLayout layout;
  layout.info = describe_volume(name, header.view.extent, header.type, {}, request);
  layout.info.files.clear();
  layout.offset = offset;
  layout.swap = must_swap(request.order.value_or(ByteOrder::little), header.type);
  const std::uint64_t end = layout.end();
  return make_stream_source(std::move(layout), make_stdin_stream(), end);
}

}  // namespace isobrick

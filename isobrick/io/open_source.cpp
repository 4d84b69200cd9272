#include "isobrick/io/open_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string_view>

#include "isobrick/core/error.h"
#include "isobrick/core/lattice.h"
#include "isobrick/io/file.h"
#include "isobrick/io/meta_image_header.h"
#include "isobrick/io/nrrd_header.h"
#include "isobrick/io/raw_name.h"
#include "isobrick/io/raw_source.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;

constexpr ByteOrder kNativeOrder =
    std::endian::native == std::endian::little ? ByteOrder::little : ByteOrder::big;

std::optional<DetachedHeader> parse_header(const std::string& path) {
  const std::string extension = lower(fs::path(path).extension().string());
  if (extension == ".nhdr") return parse_nrrd_header(path);
  if (extension == ".mhd") return parse_meta_image_header(path);
  return std::nullopt;
}

/// The header beside a raw file, if there is one and it means this very file.
std::optional<DetachedHeader> find_header_beside(const std::string& path,
                                                 const RawDescription& said) {
  for (const char* extension : {".nhdr", ".mhd"}) {
    const std::string candidate = fs::path(path).replace_extension(extension).string();
    std::error_code error;
    if (!fs::is_regular_file(candidate, error)) continue;
    try {
      auto header = parse_header(candidate);
      if (fs::equivalent(header->data_path, path, error)) return header;
    } catch (const UsageError&) {
      // Somebody who says everything does not need the header.
      if (!said.extent || !said.type) throw;
    }
  }
  return std::nullopt;
}

std::string describe(Int3 extent, ScalarType type) {
  return fmt::format("{}x{}x{} {}", extent.x, extent.y, extent.z, short_name(type));
}

/// What is said, else the header's, else the name's.
RawLayout resolve(const std::string& path, const RawDescription& said,
                  const std::optional<DetachedHeader>& header) {
  const RawName name = header ? RawName{} : parse_raw_name(fs::path(path).stem().string());
  const auto extent = said.extent ? said.extent : header ? header->extent : name.extent;
  const auto type = said.type ? said.type : header ? header->type : name.type;
  if (!extent || !type)
    throw UsageError(
        fmt::format("the {} of '{}' {} not known: say so, name the file like "
                    "'scan_256x256x128_uint8.raw', or give a .nhdr or .mhd header",
                    extent ? "type"
                    : type ? "extent"
                           : "extent and type",
                    path, extent || type ? "is" : "are"));
  RawLayout layout;
  layout.info = {*extent, *type, header ? header->transform : Transform{}, path};
  if (said.spacing) layout.info.transform.spacing = *said.spacing;
  if (said.origin) layout.info.transform.origin = *said.origin;
  if (said.unit) layout.info.transform.unit = *said.unit;
  const auto order = said.order ? said.order : header ? header->order : ByteOrder::little;
  if (!order && size_of(*type) > 1) header_error(header->path, "the field 'endian' is missing");
  layout.swap = order && *order != kNativeOrder && size_of(*type) > 1;
  return layout;
}

void check_geometry(const VolumeInfo& info) {
  const Int3 e = info.extent;
  if (e.x <= 0 || e.y <= 0 || e.z <= 0)
    throw UsageError(
        fmt::format("'{}': the extent {}x{}x{} is not positive", info.name, e.x, e.y, e.z));
  if (!checked_volume(e))
    throw UsageError(fmt::format("'{}': a volume of {}x{}x{} samples is too large to address",
                                 info.name, e.x, e.y, e.z));
  for (int i = 0; i < 3; ++i)
    if (!std::isfinite(info.transform.spacing[i]) || info.transform.spacing[i] <= 0 ||
        !std::isfinite(info.transform.origin[i]))
      throw UsageError(
          fmt::format("'{}': spacing must be positive and finite, the origin finite", info.name));
}

std::uint64_t sample_bytes(const VolumeInfo& info) {
  return static_cast<std::uint64_t>(volume(info.extent)) * size_of(info.type);
}

/// Where the text lines end that a NRRD header says to skip.
std::uint64_t after_lines(const InputFile& file, const std::string& path, std::uint64_t lines) {
  if (lines == 0) return 0;
  std::string text(std::min(file.size, kMostHeader), '\0');
  read_at(file.fd.get(), path, 0, reinterpret_cast<std::byte*>(text.data()), text.size());
  std::size_t at = 0;
  for (std::uint64_t i = 0; i < lines; ++i) {
    at = text.find('\n', at);
    if (at == std::string::npos)
      throw UsageError(fmt::format("'{}' has only {} of the {} lines to skip in its first {} bytes",
                                   path, i, lines, text.size()));
    ++at;
  }
  return at;
}

std::uint64_t find_offset(const RawDescription& said, const std::optional<DetachedHeader>& header,
                          const InputFile& file, const VolumeInfo& info) {
  if (said.offset) return *said.offset;
  if (!header) return 0;
  const std::uint64_t samples = sample_bytes(info);
  if (header->data_at_end) return file.size > samples ? file.size - samples : 0;
  return after_lines(file, info.name, header->skip_lines) + header->skip_bytes;
}

/// What else would make the size right, as " (would fit …)".
std::string size_hint(const VolumeInfo& info, std::uint64_t offset, std::uint64_t size) {
  const auto count = static_cast<std::uint64_t>(volume(info.extent));
  std::string types;
  for (const ScalarType type : kScalarTypes)
    if (size > offset && count * size_of(type) == size - offset)
      types += fmt::format("{}{}", types.empty() ? "" : " or ", short_name(type));
  if (!types.empty()) return fmt::format(" (would fit --type {})", types);
  constexpr std::uint64_t likely_header = 64 * 1024;
  const std::uint64_t needed = sample_bytes(info);
  if (size >= needed && size - needed <= likely_header)
    return fmt::format(" (would fit --offset {})", size - needed);
  return {};
}

void check_size(const RawLayout& layout, std::uint64_t size) {
  const VolumeInfo& info = layout.info;
  const std::uint64_t samples = sample_bytes(info);
  if (layout.offset <= size && size - layout.offset == samples) return;
  const std::string at = layout.offset ? fmt::format(" after offset {}", layout.offset) : "";
  throw UsageError(fmt::format("'{}' has {} bytes, but {} samples{} make {}{}", info.name, size,
                               describe(info.extent, info.type), at,
                               // Only in words if the sum would wrap around.
                               layout.offset > std::numeric_limits<std::uint64_t>::max() - samples
                                   ? std::string("far more")
                                   : fmt::format("{}", layout.offset + samples),
                               size_hint(info, layout.offset, size)));
}

std::unique_ptr<VolumeSource> open_stdin(const RawDescription& said) {
  RawLayout layout = resolve("standard input", said, std::nullopt);
  layout.offset = said.offset.value_or(0);
  check_geometry(layout.info);
  if (layout.offset > std::numeric_limits<std::uint64_t>::max() / 2)
    throw UsageError(fmt::format("an offset of {} bytes is too large", layout.offset));
  return make_stdin_source(std::move(layout));
}

}  // namespace

std::unique_ptr<VolumeSource> open_source(const std::string& path, const RawDescription& said) {
  if (path == "-") return open_stdin(said);
  auto header = parse_header(path);
  const std::string data_path = header ? header->data_path : path;
  InputFile file = open_input(data_path);
  if (!header) header = find_header_beside(path, said);
  RawLayout layout = resolve(data_path, said, header);
  check_geometry(layout.info);
  layout.offset = find_offset(said, header, file, layout.info);
  check_size(layout, file.size);
  return make_raw_source(std::move(layout), std::move(file));
}

}  // namespace isobrick

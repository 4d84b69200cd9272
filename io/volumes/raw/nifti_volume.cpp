#include "io/volumes/raw/nifti_volume.h"

#include <fmt/format.h>

#include <array>
#include <cctype>
#include <filesystem>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "io/bytes/file_stream.h"
#include "io/bytes/inflate_stream.h"
#include "io/volumes/raw/nifti_header.h"
#include "io/volumes/raw/raw_source.h"
#include "io/volumes/raw/text_header.h"
#include "io/volumes/stream_source.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// `header` needs the file, which may be itself.
std::unique_ptr<ByteStream> open_stream(const std::string& path, const std::string& header,
                                        bool packed) {
  auto stream = make_file_stream(open_data_file(path, header));
  return packed ? make_inflate_stream(std::move(stream), Wrapper::gzip) : std::move(stream);
}

/// The other file of a pair: beside `path`, with the extension `lower`, or `upper` where
/// that of `path` is in capitals; compressed or not.
std::string path_beside(const fs::path& path, const char* lower, const char* upper) {
  const bool packed = path.extension() == ".gz";
  fs::path image = packed ? path.stem() : path.filename();
  const std::string own = image.extension().string();
  image.replace_extension(
      own.size() > 1 && std::isupper(static_cast<unsigned char>(own[1])) != 0 ? upper : lower);
  image = path.parent_path() / image;
  fs::path other = image;
  (packed ? image : other) += ".gz";
  std::error_code ignored;
  return (fs::exists(image, ignored) || !fs::exists(other, ignored) ? image : other).string();
}

/// Where the samples of a header's file lie.
std::string image_path(const std::string& path) { return path_beside(path, ".img", ".IMG"); }

bool is_packed(const std::string& path, const std::string& header) {
  return open_data_file(path, header).text_at(0, 2) == "\x1f\x8b";
}

/// What a header's file begins with, unpacked.
std::vector<std::byte> read_head(const std::string& path) {
  std::vector<std::byte> head(kNiftiHeaderBytes);
  head.resize(open_stream(path, path, is_packed(path, path))->read(head.data(), head.size()));
  return head;
}

/// The same, or nothing of what cannot be read.
std::vector<std::byte> try_head(const std::string& path) {
  try {
    return read_head(path);
  } catch (const Error&) {
    return {};
  }
}

bool has_image_name(const std::string& path) {
  const std::string name = lower(path);
  return name.ends_with(".img") || name.ends_with(".img.gz");
}

/// The real values of the samples as they are stored.
std::unique_ptr<VolumeSource> scaled(std::unique_ptr<VolumeSource> stored,
                                     const NiftiHeader& header) {
  return scale_source(std::move(stored), header.scale);
}

}  // namespace

std::string nifti_header_beside(const std::string& path) {
  if (!has_image_name(path)) return {};
  const std::string header = path_beside(path, ".hdr", ".HDR");
  const std::vector<std::byte> head = try_head(header);
  if (is_analyze(head))
    throw UsageError(fmt::format("'{}' has the header '{}': {}", path, header, kAnalyzeRefusal));
  return is_nifti_pair(head) ? header : std::string();
}

std::string nifti_pair_hint(const std::string& path) {
  if (!has_image_name(path)) return {};
  const std::string header = path_beside(path, ".hdr", ".HDR");
  std::error_code ignored;
  return fs::exists(header, ignored)
             ? fmt::format("; '{}' beside it is not the header of a NIfTI pair", header)
             : fmt::format("; the image of a NIfTI pair needs its header '{}' beside it", header);
}

std::unique_ptr<VolumeSource> open_nifti(const std::string& path, const VolumeRequest& request) {
  refuse_raw_description(path, "a NIfTI file", request);
  const NiftiHeader header = parse_nifti_header(path, read_head(path), request.selection);
  const std::string data_path = header.detached ? image_path(path) : path;
  const std::size_t sample = size_of(header.type);
  SampleLayout layout;
  layout.info =
      describe_volume(data_path, header.view.extent, header.type, header.transform, request);
  layout.info.files = {path, data_path};
  if (header.is_label_image) layout.info.labels.emplace();
  layout.offset = header.offset + static_cast<std::uint64_t>(header.view.first) * sample;
  layout.swap = header.swap && sample > 1;
  layout.stride = header.view.stride;
  if (header.detached) layout.header = path;
  const std::uint64_t end = header.offset + static_cast<std::uint64_t>(header.view.total) * sample;
  if (is_packed(data_path, path))
    return scaled(make_stream_source(std::move(layout), open_stream(data_path, path, true), end,
                                     AfterEnd::noted),
                  header);
  File file = open_data_file(data_path, path);
  check_header_promise(layout, file);
  if (const std::uint64_t size = file.size(); size > end)
    layout.notes.push_back(trailing_note(quoted(file.path()), size - end));
  return scaled(make_raw_source(std::move(layout), std::move(file)), header);
}

}  // namespace isobrick

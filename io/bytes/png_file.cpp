#include "io/bytes/png_file.h"

#include <fmt/format.h>
#include <png.h>

#include <vector>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

std::vector<std::byte> encode_png(const std::string& name, int width, int height,
                                  std::span<const std::uint8_t> rgb) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = PNG_FORMAT_RGB;
  const std::size_t samples =
      3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (width <= 0 || height <= 0 || rgb.size() != samples)
    throw Error(
        fmt::format("'{}': {} bytes are no picture of {}x{}", name, rgb.size(), width, height));
  std::vector<std::byte> bytes(PNG_IMAGE_PNG_SIZE_MAX(image));
  png_alloc_size_t size = bytes.size();
  if (!png_image_write_to_memory(&image, bytes.data(), &size, 0, rgb.data(), 0, nullptr))
    throw Error(fmt::format("cannot make the picture '{}': {}", name, image.message));
  bytes.resize(size);
  return bytes;
}

void write_png(OutputFile& out, int width, int height, std::span<const std::uint8_t> rgb) {
  // From memory, so that writing errors are reported like those of any other file.
  out.writer().append(encode_png(out.path(), width, height, rgb));
  out.publish();
}

void write_png(const std::string& path, int width, int height, std::span<const std::uint8_t> rgb,
               bool force) {
  OutputFile out(path, force);
  write_png(out, width, height, rgb);
}

}  // namespace isobrick

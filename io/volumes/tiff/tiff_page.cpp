#include "io/volumes/tiff/tiff_page.h"

#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstring>

#include <isobrick/error.h>
#include "core/printable.h"

namespace isobrick::inline v0 {
namespace {

/// No strip, tile or table of a page may take more.
constexpr std::size_t kMaxBlock = std::size_t{512} << 20;

/// libtiff's words into a string, made fit for one line.
int keep_message(TIFF*, void* to, const char*, const char* format, va_list words) {
  char text[400];
  std::vsnprintf(text, sizeof(text), format, words);
  *static_cast<std::string*>(to) = printable(text, sizeof(text));
  return 1;
}

int ignore_warning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

TIFF* open_quietly(const std::string& path, std::string* message) {
  TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
  if (options == nullptr) throw Error("out of memory");
  TIFFOpenOptionsSetMaxSingleMemAlloc(options, static_cast<tmsize_t>(kMaxBlock));
  TIFFOpenOptionsSetErrorHandlerExtR(options, keep_message, message);
  TIFFOpenOptionsSetWarningHandlerExtR(options, ignore_warning, nullptr);
  TIFF* file = TIFFOpenExt(path.c_str(), "rm", options);  // m: no memory map
  TIFFOpenOptionsFree(options);
  return file;
}

template <class T>
bool get(TIFF* file, std::uint32_t tag, T& value) {
  return TIFFGetField(file, tag, &value) == 1;
}

ScalarType read_type(const std::string& path, int bits, int format) {
  constexpr int kFloat = SAMPLEFORMAT_IEEEFP, kSigned = SAMPLEFORMAT_INT;
  if (format == kFloat && bits == 32) return ScalarType::f32;
  if (format == kFloat && bits == 64) return ScalarType::f64;
  if (format == kSigned && bits == 8) return ScalarType::i8;
  if (format == kSigned && bits == 16) return ScalarType::i16;
  if (format == kSigned && bits == 32) return ScalarType::i32;
  if (format == kSigned && bits == 64) return ScalarType::i64;
  const bool plain = format == SAMPLEFORMAT_UINT || format == SAMPLEFORMAT_VOID;
  if (plain && bits == 8) return ScalarType::u8;
  if (plain && bits == 16) return ScalarType::u16;
  if (plain && bits == 32) return ScalarType::u32;
  if (plain && bits == 64) return ScalarType::u64;
  throw UsageError(fmt::format("'{}': samples of {} bits (SampleFormat {}) are not supported", path,
                               bits, format));
}

}  // namespace

/// The pixels to be read and where they go.
struct TiffFile::Window {
  std::uint32_t x0, y0, x1, y1;
  std::uint16_t sample;
  std::byte* out;

  /// Copies what a decoded block, whose first pixel is (x, y), shares with the
  /// window. `step`: samples from one pixel of the block to the next.
  void copy(const std::byte* block, std::uint32_t x, std::uint32_t y, std::uint32_t width,
            std::uint32_t height, std::size_t step, std::size_t size) const {
    const std::uint32_t left = std::max(x, x0), right = std::min(x + width, x1);
    const std::uint32_t top = std::max(y, y0), bottom = std::min(y + height, y1);
    for (std::uint32_t row = top; row < bottom && left < right; ++row) {
      const std::byte* from = block + (std::size_t{row - y} * width + (left - x)) * step * size +
                              (step > 1 ? sample * size : 0);
      std::byte* to = out + (std::size_t{row - y0} * (x1 - x0) + (left - x0)) * size;
      if (step == 1) {
        std::memcpy(to, from, std::size_t{right - left} * size);
        continue;
      }
      for (std::uint32_t i = left; i < right; ++i, from += step * size, to += size)
        std::memcpy(to, from, size);
    }
  }
};

void TiffFile::TiffDeleter::operator()(tiff* file) const { TIFFClose(file); }

TiffFile::TiffFile(const std::string& path)
    : path_(path), file_(open_quietly(path, &last_message_)) {
  if (!file_) fail("cannot be read as a TIFF file");
}

TiffFile::~TiffFile() = default;

void TiffFile::fail(const std::string& what) const {
  throw DamageError(fmt::format("'{}' {}{}", path_, what,
                                last_message_.empty() ? "" : " (" + last_message_ + ")"));
}

std::uint32_t TiffFile::number(std::uint32_t tag, std::uint32_t fallback) const {
  std::uint32_t value = fallback;
  get(file_.get(), tag, value);
  return value;
}

bool TiffFile::next_page() {
  last_message_.clear();
  if (TIFFReadDirectory(file_.get()) == 1) return true;
  if (!last_message_.empty()) fail("has a page that cannot be read");
  return false;
}

void TiffFile::go_to(std::uint64_t offset) {
  if (offset != this->offset() && TIFFSetSubDirectory(file_.get(), offset) != 1)
    fail(fmt::format("has no page at offset {}", offset));
}

std::uint64_t TiffFile::offset() const { return TIFFCurrentDirOffset(file_.get()); }

bool TiffFile::is_reduced() const {
  return (number(TIFFTAG_SUBFILETYPE, 0) & (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) != 0;
}

std::string TiffFile::description() const {
  const char* text = nullptr;
  return get(file_.get(), TIFFTAG_IMAGEDESCRIPTION, text) && text != nullptr ? text : "";
}

double TiffFile::resolution(int axis) const {
  float value = 0;
  get(file_.get(), axis == 0 ? TIFFTAG_XRESOLUTION : TIFFTAG_YRESOLUTION, value);
  return value;
}

TiffPage TiffFile::page() const {
  TiffPage page;
  std::uint16_t bits = 1, format = SAMPLEFORMAT_UINT, photometric = PHOTOMETRIC_MINISBLACK,
                compression = COMPRESSION_NONE;
  TIFF* const file = file_.get();
  get(file, TIFFTAG_IMAGEWIDTH, page.width);
  get(file, TIFFTAG_IMAGELENGTH, page.height);
  TIFFGetFieldDefaulted(file, TIFFTAG_BITSPERSAMPLE, &bits);
  TIFFGetFieldDefaulted(file, TIFFTAG_SAMPLESPERPIXEL, &page.samples);
  TIFFGetFieldDefaulted(file, TIFFTAG_SAMPLEFORMAT, &format);
  TIFFGetFieldDefaulted(file, TIFFTAG_COMPRESSION, &compression);
  get(file, TIFFTAG_PHOTOMETRIC, photometric);
  page.type = read_type(path_, bits, format);
  constexpr std::uint32_t kMax = std::uint32_t{1} << 30;
  if (page.width == 0 || page.height == 0 || page.samples == 0 || page.width > kMax ||
      page.height > kMax)
    throw UsageError(fmt::format("'{}': a page of {} x {} pixels with {} samples makes no sense",
                                 path_, page.width, page.height, page.samples));
  if (photometric == PHOTOMETRIC_YCBCR)
    throw UsageError(fmt::format("'{}': pixels in YCbCr colours are not supported", path_));
  if (!TIFFIsCODECConfigured(compression))
    throw UsageError(
        fmt::format("'{}': libtiff here cannot decompress method {}", path_, compression));
  if (number(TIFFTAG_IMAGEDEPTH, 1) > 1)
    throw UsageError(
        fmt::format("'{}': pages that are volumes (ImageDepth) are not supported", path_));
  if (block_bytes() > kMaxBlock)
    throw UsageError(fmt::format("'{}': strips or tiles of {} bytes are too large (at most {})",
                                 path_, block_bytes(), kMaxBlock));
  return page;
}

std::size_t TiffFile::block_bytes() const {
  return static_cast<std::size_t>(TIFFIsTiled(file_.get()) ? TIFFTileSize64(file_.get())
                                                           : TIFFStripSize64(file_.get()));
}

std::size_t TiffFile::memory() const {
  // A block as it is decoded and as it lies in the file, and the tables of the page.
  const std::size_t blocks =
      TIFFIsTiled(file_.get()) ? TIFFNumberOfTiles(file_.get()) : TIFFNumberOfStrips(file_.get());
  return 2 * block_bytes() + 16 * blocks + (std::size_t{1} << 16);
}

bool TiffFile::find_plain(PlainSamples& plain) const {
  std::uint16_t compression = COMPRESSION_NONE;
  TIFFGetFieldDefaulted(file_.get(), TIFFTAG_COMPRESSION, &compression);
  if (compression != COMPRESSION_NONE || TIFFIsTiled(file_.get())) return false;
  plain.offset = TIFFGetStrileOffset(file_.get(), 0);
  plain.swap = TIFFIsByteSwapped(file_.get()) != 0;
  return true;
}

void TiffFile::read(std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1,
                    std::uint16_t sample, std::byte* out) {
  const TiffPage page = this->page();
  std::uint16_t planar = PLANARCONFIG_CONTIG;
  TIFFGetFieldDefaulted(file_.get(), TIFFTAG_PLANARCONFIG, &planar);
  const std::size_t bytes = block_bytes();
  if (bytes > block_size_) {
    block_ = std::make_unique_for_overwrite<std::byte[]>(bytes);
    block_size_ = bytes;
  }
  const bool apart = planar == PLANARCONFIG_SEPARATE && page.samples > 1;
  const Window window{x0, y0, x1, y1, sample, out};
  if (TIFFIsTiled(file_.get()))
    read_tiles(window, page, apart);
  else
    read_strips(window, page, apart);
}

void TiffFile::read_strips(const Window& window, const TiffPage& page, bool apart) {
  const std::size_t size = size_of(page.type), step = apart ? 1 : page.samples;
  const std::uint32_t rows =
      std::clamp<std::uint32_t>(number(TIFFTAG_ROWSPERSTRIP, page.height), 1, page.height);
  const bool whole_rows = window.x0 == 0 && window.x1 == page.width && step == 1;
  for (std::uint32_t y = window.y0 / rows * rows; y < window.y1; y += rows) {
    const std::uint32_t height = std::min(rows, page.height - y);
    const std::uint32_t strip = TIFFComputeStrip(file_.get(), y, apart ? window.sample : 0);
    const auto bytes = static_cast<tmsize_t>(std::size_t{height} * page.width * step * size);
    // Decoded where it belongs if nothing of it is left over.
    const bool direct = whole_rows && y >= window.y0 && y + height <= window.y1;
    std::byte* to =
        direct ? window.out + std::size_t{y - window.y0} * page.width * size : block_.get();
    if (static_cast<std::size_t>(bytes) > block_size_ ||
        TIFFReadEncodedStrip(file_.get(), strip, to, bytes) != bytes)
      fail(fmt::format("cannot be read: strip {} of the page at offset {}", strip, offset()));
    if (!direct) window.copy(block_.get(), 0, y, page.width, height, step, size);
  }
}

void TiffFile::read_tiles(const Window& window, const TiffPage& page, bool apart) {
  const std::size_t size = size_of(page.type), step = apart ? 1 : page.samples;
  const std::uint32_t width = number(TIFFTAG_TILEWIDTH, 0), height = number(TIFFTAG_TILELENGTH, 0);
  if (width == 0 || height == 0 || std::size_t{width} * height * step * size > block_size_)
    fail("has tiles without a size");
  const auto bytes = static_cast<tmsize_t>(std::size_t{width} * height * step * size);
  for (std::uint32_t y = window.y0 / height * height; y < window.y1; y += height)
    for (std::uint32_t x = window.x0 / width * width; x < window.x1; x += width) {
      const std::uint32_t tile =
          TIFFComputeTile(file_.get(), x, y, 0, apart ? window.sample : std::uint16_t{0});
      if (TIFFReadEncodedTile(file_.get(), tile, block_.get(), bytes) != bytes)
        fail(fmt::format("cannot be read: tile {} of the page at offset {}", tile, offset()));
      window.copy(block_.get(), x, y, width, height, step, size);
    }
}

}  // namespace isobrick

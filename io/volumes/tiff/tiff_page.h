#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <isobrick/scalar.h>

struct tiff;

namespace isobrick::inline v0 {

/// The samples of a page of a TIFF file.
struct TiffPage {
  std::uint32_t width = 0, height = 0;
  std::uint16_t samples = 1;  ///< of a pixel
  ScalarType type;

  friend bool operator==(const TiffPage&, const TiffPage&) = default;
};

/// An open TIFF file at one of its pages. One thread at a time.
class TiffFile {
 public:
  /// At the first page. Throws Error or UsageError.
  explicit TiffFile(const std::string& path);
  ~TiffFile();
  TiffFile(const TiffFile&) = delete;
  TiffFile& operator=(const TiffFile&) = delete;

  /// Goes to the next page; false after the last one.
  bool next_page();
  /// Goes to the page at an offset that `offset` returned.
  void go_to(std::uint64_t offset);
  std::uint64_t offset() const;

  /// Throws UsageError for what is not supported.
  TiffPage page() const;
  /// A thumbnail of another page, or a mask.
  bool is_reduced() const;
  /// ImageDescription, or empty.
  std::string description() const;
  /// Pixels along x and y in one unit; 0 where the page has none.
  double resolution(int axis) const;
  /// Where the samples begin, if they lie uncompressed in one piece, and whether
  /// they are of the other byte order.
  struct PlainSamples {
    std::uint64_t offset = 0;
    bool swap = false;
  };
  bool find_plain(PlainSamples& plain) const;

  /// Bytes that reading a page takes for itself.
  std::size_t memory() const;

  /// Copies one of each pixel's samples, of the pixels [x0, x1) × [y0, y1), to
  /// `out`. Throws DamageError.
  void read(std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1,
            std::uint16_t sample, std::byte* out);

 private:
  struct Window;
  struct TiffDeleter {
    void operator()(tiff* file) const;
  };

  void read_strips(const Window& window, const TiffPage& page, bool apart);
  void read_tiles(const Window& window, const TiffPage& page, bool apart);
  std::size_t block_bytes() const;
  [[noreturn]] void fail(const std::string& what) const;
  std::uint32_t number(std::uint32_t tag, std::uint32_t fallback) const;

  std::string path_;
  std::string last_message_;  ///< the last message of libtiff
  std::unique_ptr<tiff, TiffDeleter> file_;
  std::unique_ptr<std::byte[]> block_;
  std::size_t block_size_ = 0;
};

}  // namespace isobrick

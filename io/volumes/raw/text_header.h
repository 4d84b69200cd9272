#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/array_view.h>
#include <isobrick/sample_value.h>
#include <isobrick/scalar.h>
#include <isobrick/transform.h>
#include <isobrick/vec.h>
#include <isobrick/volume_request.h>
#include "io/bytes/file.h"

namespace isobrick::inline v0 {

enum class Encoding : std::uint8_t { raw, gzip, zlib, text };

/// A text header of samples that follow it or lie in files of their own.
struct TextHeader {
  std::string path;                     ///< of the header itself, for messages
  std::vector<std::string> data_paths;  ///< of the samples; several follow one another
  std::uint64_t data_begin = 0;         ///< where the samples' part of the file begins, …
  std::uint64_t skip_lines = 0;         ///< … text lines before the samples there, …
  std::uint64_t skip_bytes = 0;         ///< … then so many bytes
  bool data_at_end = false;             ///< instead: the samples are the end of the file
  Encoding encoding = Encoding::raw;
  ArrayView view;
  ScalarType type;
  std::optional<ByteOrder> order;
  Transform transform;
  std::string grid_class, grid_name;  ///< as VolumeInfo has them
  std::optional<SampleValue> fill_value;
  std::optional<LabelTable> labels;  ///< as VolumeInfo has them

  bool attached() const { return data_paths.front() == path; }
};

// What the parsers of such headers share. All throw UsageError that begins
// with the header's path; nothing in a header may cost more than kMaxHeader.

inline constexpr std::uint64_t kMaxHeader = std::uint64_t{1} << 20;

/// Opens the file of samples that a header needs; where that fails, the message names both.
File open_data_file(const std::string& path, const std::string& header);

[[noreturn]] void header_error(const std::string& path, const std::string& what);

/// The lines at the beginning of a file; samples may follow them.
class HeaderLines {
 public:
  explicit HeaderLines(const std::string& path);

  bool at_end() const { return rest_.empty(); }
  /// The next line without its end (LF or CR LF). Refuses NUL bytes, and headers
  /// longer than kMaxHeader.
  std::string_view next();
  /// Passes over bytes, which may be anything. Refuses more than kMaxHeader has.
  void skip(std::uint64_t bytes);
  /// What comes next, as far as it was read.
  std::string_view rest() const { return rest_; }
  /// Bytes before the line that comes next.
  std::uint64_t position() const { return text_.size() - rest_.size(); }

 private:
  std::string path_, text_;
  std::string_view rest_;
  std::uint64_t file_size_ = 0;
};

std::string_view trim(std::string_view text);
std::string lower(std::string_view text);
std::vector<std::string_view> split_words(std::string_view text);

Index parse_integer(const std::string& path, std::string_view field, std::string_view word);
/// Refuses infinities; NaN only where `nan_allowed`.
double parse_real(const std::string& path, std::string_view field, std::string_view word,
                  bool nan_allowed = false);

/// The data file that a header in `path` names: in its folder or below. Names
/// that leave the folder are refused.
std::string resolve_data_file(const std::string& path, std::string_view name);

/// The data files that "PATTERN FIRST LAST [STEP]" means, PATTERN as of printf
/// with one number ("slice%03d.raw"). The numbers fall where STEP is negative.
std::vector<std::string> resolve_data_pattern(const std::string& path, std::string_view text);

/// Sets direction and spacing from the world vectors of one step along each
/// index axis, which must be at right angles.
void set_axes(const std::string& path, Transform& transform, const Vec3d (&axes)[3]);

}  // namespace isobrick

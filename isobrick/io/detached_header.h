#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "isobrick/core/scalar.h"
#include "isobrick/core/transform.h"
#include "isobrick/core/vec.h"
#include "isobrick/io/open_source.h"

namespace isobrick {

/// What a text header says about samples that lie in a file of their own.
struct DetachedHeader {
  std::string path;       ///< of the header itself, for messages
  std::string data_path;  ///< of the samples
  Int3 extent;
  ScalarType type = ScalarType::u8;
  std::optional<ByteOrder> order;
  std::uint64_t skip_lines = 0;  ///< text lines before the samples, …
  std::uint64_t skip_bytes = 0;  ///< … then so many bytes
  bool data_at_end = false;      ///< instead: the samples are the end of the file
  Transform transform;
};

// What the parsers of such headers share. All throw UsageError that begins
// with the header's path; nothing in a header may cost more than kMostHeader.

inline constexpr std::uint64_t kMostHeader = std::uint64_t{1} << 20;

[[noreturn]] void header_error(const std::string& path, const std::string& what);

/// The whole text; refuses NUL bytes and files longer than kMostHeader.
std::string read_header_text(const std::string& path);

/// Cuts the next line off `text`, without its end (LF or CR LF).
std::string_view next_line(std::string_view& text);

std::string_view trim(std::string_view text);
std::string lower(std::string_view text);
std::vector<std::string_view> split_words(std::string_view text);

Index parse_integer(const std::string& path, std::string_view field, std::string_view word);
/// Refuses infinities; NaN only where `nan_allowed`.
double parse_real(const std::string& path, std::string_view field, std::string_view word,
                  bool nan_allowed = false);

/// The data file that a header in `path` names: in its folder or below. Lists,
/// numbered patterns and names that leave the folder are refused.
std::string resolve_data_file(const std::string& path, std::string_view name);

/// Sets direction and spacing from the world vectors of one step along each
/// index axis, which must be at right angles.
void set_axes(const std::string& path, Transform& transform, const Vec3d (&axes)[3]);

/// "mm" → "millimeter" and so on; what is not known becomes empty.
std::string unit_name(std::string_view unit);

}  // namespace isobrick

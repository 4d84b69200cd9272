#include "io/meshes/readers/mesh_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include <isobrick/error.h>
#include "io/bytes/mapped_file.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kMaxLine = 1 << 16;

}  // namespace

bool MeshText::next_line() {
  if (rest_.empty()) {
    line_ = {};
    return false;
  }
  ++number_;
  const std::size_t end = std::min(rest_.find('\n'), rest_.size());
  if (end > kMaxLine) fail(fmt::format("it is {} bytes long", end));
  MappedFile::note_read(end);
  line_ = rest_.substr(0, end);
  rest_.remove_prefix(std::min(end + 1, rest_.size()));
  return true;
}

std::string_view MeshText::word() {
  const std::size_t begin = line_.find_first_not_of(" \t\r");
  if (begin == line_.npos) return line_ = {};
  const std::size_t end = std::min(line_.find_first_of(" \t\r", begin), line_.size());
  const std::string_view found = line_.substr(begin, end - begin);
  line_.remove_prefix(end);
  return found;
}

std::string_view MeshText::rest_of_line() const {
  return line_.substr(std::min(line_.find_first_not_of(" \t"), line_.size()));
}

std::string_view MeshText::next_word() {
  std::string_view found = word();
  while (found.empty() && next_line()) found = word();
  return found;
}

Vec3d MeshText::vector() {
  Vec3d v;
  for (int axis = 0; axis < 3; ++axis) v[axis] = number();
  return v;
}

double MeshText::parse(std::string_view word) const {
  const std::string_view digits = word.substr(word.starts_with('+') ? 1 : 0);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size())
    fail(fmt::format("'{}' is no number", word.substr(0, 60)));
  return value;
}

void MeshText::fail(const std::string& what) const {
  throw Error(fmt::format("'{}' is no {} file that can be drawn: line {}: {}", path_, format_,
                          number_, what));
}

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// The words of a mesh file of text, which is mapped and must live as long: line by line, or one
/// after the other wherever lines end. Errors name the file and the line.
class MeshText {
 public:
  /// `format` is for messages: "OBJ". `lines`: those of the file before `text`.
  MeshText(std::string path, std::string_view format, std::string_view text,
           std::uint64_t lines = 0)
      : path_(std::move(path)), format_(format), rest_(text), number_(lines) {}

  /// Goes to the next line; false at the end. A '\' at a line's end is not read.
  bool next_line();
  /// The line's next word; empty at its end.
  std::string_view word();
  /// What is left of the line, without leading blanks.
  std::string_view rest_of_line() const;
  /// The next word of this line or a later one; empty at the end of the text.
  std::string_view next_word();

  /// The line's next words as numbers.
  double number() { return parse(word()); }
  Vec3d vector();
  /// A word as a number.
  double parse(std::string_view word) const;

  /// Bytes that have not been read.
  std::size_t bytes_left() const { return line_.size() + rest_.size(); }

  [[noreturn]] void fail(const std::string& what) const;

 private:
  std::string path_;
  std::string_view format_, rest_, line_;
  std::uint64_t number_;
};

}  // namespace isobrick

#pragma once

#include <string>

namespace isobrick::test {

/// Bytes as hexadecimal digits: frozen bytes that can be read in a diff.
inline std::string hex(const std::string& bytes) {
  std::string text;
  for (const char c : bytes) {
    constexpr char digits[] = "0123456789abcdef";
    text += digits[static_cast<unsigned char>(c) >> 4];
    text += digits[static_cast<unsigned char>(c) & 15];
  }
  return text;
}

}  // namespace isobrick::test

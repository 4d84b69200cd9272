#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "io/bytes/byte_stream.h"

namespace isobrick::inline v0 {

/// A VTK file in XML, whatever it holds.
struct VtkFile {
  std::string path;
  std::uint64_t bytes = 0;
  /// A stream of the bytes from `begin`, which is at most the file's size, to the end.
  std::function<std::unique_ptr<ByteStream>(std::uint64_t begin)> open;
  /// Throws the error of the format's reader.
  void (*refuse)(const std::string& path, const std::string& what) = nullptr;

  [[noreturn]] void fail(const std::string& what) const;
};

/// An element: its attributes, and where its own text begins in the file.
struct VtkElement {
  std::map<std::string, std::string> attributes;
  std::uint64_t content = 0;

  bool empty() const { return attributes.empty(); }
  /// An attribute, or `fallback` where the element lacks it.
  std::string get(const char* name, const char* fallback = "") const;
};

/// The elements that describe all arrays of a file.
struct VtkHeader {
  VtkElement file, appended;  ///< <VTKFile> and <AppendedData>
};

}  // namespace isobrick

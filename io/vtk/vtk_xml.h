#pragma once

#include <cstdint>
#include <exception>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "io/vtk/vtk_file.h"

struct XML_ParserStruct;

namespace isobrick::inline v0 {

/// Parses the XML of a VTK file. The readers of the formats derive from it and take the elements
/// that they need.
class VtkXml {
 public:
  VtkXml(const VtkXml&) = delete;
  VtkXml& operator=(const VtkXml&) = delete;
  virtual ~VtkXml();

 protected:
  /// `types` are those that <VTKFile> may have; the first is named in errors. `file` must outlive
  /// it.
  VtkXml(const VtkFile& file, std::initializer_list<std::string_view> types);

  /// Reads the file until stop() or its end. False at the end. Fails for what is no such file, and
  /// throws what start() and end() throw.
  bool parse();
  void stop() { stopped_ = true; }
  /// An element after <VTKFile> begins, or ends.
  virtual void start(const std::string& name, VtkElement element) = 0;
  virtual void end(const std::string& name) = 0;

  const VtkFile& file() const { return file_; }
  VtkHeader& header() { return header_; }

 private:
  struct ParserDeleter {
    void operator()(XML_ParserStruct* parser) const;
  };
  template <class F>
  static void guard(void* self, F&& f);
  static void on_start(void* self, const char* name, const char** attributes);
  static void on_end(void* self, const char* name);
  static void on_doctype(void* self, const char*, const char*, const char*, int);
  void start_element(const std::string& name, VtkElement element);
  std::uint64_t position() const;

  const VtkFile& file_;
  const std::vector<std::string_view> types_;
  std::unique_ptr<XML_ParserStruct, ParserDeleter> parser_;
  std::exception_ptr failure_;
  bool stopped_ = false;
  VtkHeader header_;
};

}  // namespace isobrick

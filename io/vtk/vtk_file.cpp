#include "io/vtk/vtk_file.h"

#include <exception>

namespace isobrick::inline v0 {

void VtkFile::fail(const std::string& what) const {
  refuse(path, what);
  std::terminate();  // refuse() has not thrown
}

std::string VtkElement::get(const char* name, const char* fallback) const {
  const auto at = attributes.find(name);
  return at == attributes.end() ? fallback : at->second;
}

}  // namespace isobrick

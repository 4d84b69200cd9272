#include "io/volumes/open/module_loader.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <filesystem>
#include <string_view>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Opens a module: beside the program, as both a build and an installation have it, else where the
/// program's run path leads, which our package for CMake sets for programs of others. No folder of
/// the machine that compiled this is looked at.
void* open_library(const std::string& file, std::string_view format) {
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  const fs::path beside = program.parent_path() / ISOBRICK_MODULES_BESIDE / file;
  const bool is_beside = !ignored && fs::exists(beside, ignored);
  // It stays until the program ends. Lazily: few of its libraries' functions are called.
  void* library = ::dlopen(is_beside ? beside.c_str() : file.c_str(), RTLD_LAZY | RTLD_LOCAL);
  if (library != nullptr) return library;
  const std::string why = ::dlerror();
  if (is_beside || !why.starts_with(file + ": cannot open shared object file"))
    throw Error(fmt::format("cannot load {}: {}", file, why));
  throw Error(fmt::format(
      "{} need {}, which is neither in '{}' nor on the library path: install isobrick as a whole, "
      "or name the folder of its modules in LD_LIBRARY_PATH",
      format, file, beside.parent_path().lexically_normal().string()));
}

/// What the function of a module returns; `format` is for messages.
template <class Module>
const Module& load(std::string_view name, std::string_view format) {
  const std::string file = fmt::format("isobrick_{}{}", name, ISOBRICK_MODULE_SUFFIX);
  using Get = const Module* (*)();
  const auto get = reinterpret_cast<Get>(::dlsym(open_library(file, format), "isobrick_module"));
  if (get == nullptr || std::string_view(get()->version) != ISOBRICK_VERSION)
    throw Error(
        fmt::format("{} is not of this version of isobrick ({}): install isobrick as a whole", file,
                    ISOBRICK_VERSION));
  return *get();
}

}  // namespace

const Hdf5Module& hdf5_module() {
  static const auto& module = load<Hdf5Module>("hdf5", "HDF5 files");
  return module;
}

const DicomModule& dicom_module() {
  static const auto& module = load<DicomModule>("dicom", "DICOM files");
  return module;
}

const VdbModule& vdb_module() {
  static const auto& module = load<VdbModule>("openvdb", "OpenVDB files");
  return module;
}

}  // namespace isobrick

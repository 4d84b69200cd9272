#include "isobrick/volumes/module_loader.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <filesystem>
#include <string_view>

#include "isobrick/core/error.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;

/// Folders of modules: beside the program, as both a build and an installation have
/// it; else where this library was built or was to be installed, for programs of
/// others.
std::vector<fs::path> folders() {
  std::vector<fs::path> found;
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  if (!ignored) found.push_back(program.parent_path() / ISOBRICK_MODULES_BESIDE);
  found.emplace_back(ISOBRICK_MODULES_BUILT);
  found.emplace_back(ISOBRICK_MODULES_INSTALLED);
  return found;
}

/// What the function of a module returns; `format` is for messages.
template <class Module>
const Module& load(std::string_view name, std::string_view format) {
  const std::string file = fmt::format("isobrick_{}{}", name, ISOBRICK_MODULE_SUFFIX);
  std::error_code ignored;
  for (const fs::path& folder : folders()) {
    const fs::path path = folder / file;
    if (!fs::exists(path, ignored)) continue;
    // It stays until the program ends. Lazily: few of its libraries' functions are called.
    void* library = ::dlopen(path.c_str(), RTLD_LAZY | RTLD_LOCAL);
    if (library == nullptr) throw Error(fmt::format("cannot load {}: {}", file, ::dlerror()));
    using Get = const Module* (*)();
    const auto get = reinterpret_cast<Get>(::dlsym(library, "isobrick_module"));
    if (get == nullptr || std::string_view(get()->version) != ISOBRICK_VERSION)
      throw Error(fmt::format("'{}' is not of this version of isobrick ({})", path.string(),
                              ISOBRICK_VERSION));
    return *get();
  }
  throw Error(fmt::format("{} need '{}', which is not there: install isobrick as a whole", format,
                          (folders().back() / file).string()));
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

#include <dlfcn.h>
#include <fmt/format.h>

#include <filesystem>
#include <string_view>
#include <vector>

#include "isobrick/core/error.h"
#include "isobrick/volumes/vdb_module.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;

/// Beside the program, as both a build and an installation have it; else where
/// this library was built or was to be installed, for programs of others.
std::vector<fs::path> places() {
  std::vector<fs::path> found;
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  if (!ignored) found.push_back(program.parent_path() / ISOBRICK_MODULE_BESIDE);
  found.emplace_back(ISOBRICK_MODULE_BUILT);
  found.emplace_back(ISOBRICK_MODULE_INSTALLED);
  return found;
}

const VdbModule& load() {
  std::error_code ignored;
  for (const fs::path& path : places()) {
    if (!fs::exists(path, ignored)) continue;
    // It stays until the program ends.
    void* library = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) throw Error(fmt::format("cannot load OpenVDB: {}", ::dlerror()));
    using Get = const VdbModule* (*)();
    const auto get = reinterpret_cast<Get>(::dlsym(library, kVdbModuleSymbol));
    if (get == nullptr || std::string_view(get()->version) != ISOBRICK_VERSION)
      throw Error(fmt::format("'{}' is not of this version of isobrick ({})", path.string(),
                              ISOBRICK_VERSION));
    return *get();
  }
  throw Error(
      fmt::format("OpenVDB files need '{}', which is not there: install isobrick as a whole",
                  places().back().string()));
}

}  // namespace

const VdbModule& vdb_module() {
  static const VdbModule& module = load();
  return module;
}

}  // namespace isobrick

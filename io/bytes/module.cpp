#include "io/bytes/module.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <filesystem>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Opens a module: beside the program, as both a build and an installation have it, else where the
/// program's run path leads, which our package for CMake sets for programs of others. No folder of
/// the machine that compiled this is looked at.
void* open_library(const std::string& file, std::string_view user) {
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
      user, file, beside.parent_path().lexically_normal().string()));
}

/// What the function of a module returns; `format` is for messages.
}  // namespace

const void* load_module(std::string_view name, std::string_view user) {
  const std::string file = fmt::format("isobrick_{}{}", name, ISOBRICK_MODULE_SUFFIX);
  using Get = const void* (*)();
  const auto get = reinterpret_cast<Get>(::dlsym(open_library(file, user), "isobrick_module"));
  const void* module = get != nullptr ? get() : nullptr;
  const std::string_view version =
      module != nullptr ? *static_cast<const char* const*>(module) : "";
  if (version != ISOBRICK_VERSION)
    throw Error(
        fmt::format("{} is not of this version of isobrick ({}): install isobrick as a whole", file,
                    ISOBRICK_VERSION));
  return module;
}

}  // namespace isobrick

#pragma once

#include <string>
#include <string_view>

namespace isobrick::inline v0 {

/// The structure that a module returns. `name`: the file is isobrick_NAME.so. `user` is what needs
/// it, for messages: "HDF5 files". Modules are shared objects whose libraries take longer to link
/// than most commands take; they are loaded when they are first needed and stay until the program
/// ends. Each has one function, isobrick_module(), that returns the address of a structure which
/// begins with the version of isobrick that it belongs to. Throws Error when the module is not
/// where it belongs or is of another version.
const void* load_module(std::string_view name, std::string_view user);

/// The same with the type of the structure.
template <class Module>
const Module& load_module(std::string_view name, std::string_view user) {
  return *static_cast<const Module*>(load_module(name, user));
}

}  // namespace isobrick

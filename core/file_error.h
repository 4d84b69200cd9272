#pragma once

#include <exception>
#include <string>

namespace isobrick::inline v0 {

/// The message of an exception. The standard library's of files are put as ours are.
std::string error_message(const std::exception& error);

}  // namespace isobrick

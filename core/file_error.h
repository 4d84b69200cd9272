#pragma once

#include <exception>
#include <string>

namespace isobrick {

/// The message of an exception. The standard library's of files are put as ours are.
std::string what_of(const std::exception& error);

}  // namespace isobrick

#pragma once

#include <stdexcept>
#include <string>

namespace isobrick {

/// Anything that stops a command. The message is one line: what is wrong, where (file, offset,
/// brick) and what to do. The program prints it and exits with 1.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The request itself makes no sense (wrong option, wrong size for the
/// dimensions). The program prints it and exits with 2.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// Stored bytes are not what they must be: a checksum, a size or a field is
/// wrong. `verify` collects these; every other reader stops at the first.
class DamageError : public Error {
 public:
  using Error::Error;
};

/// The user ended the program (see cancel.h) while it waited for input.
class Cancelled : public Error {
 public:
  using Error::Error;
};

/// "cannot open 'path': Permission denied" for the given errno value.
Error system_error(const std::string& what, const std::string& path, int errno_value);

}  // namespace isobrick

#pragma once

#include <stdexcept>
#include <string>

#include <isobrick/api.h>

namespace isobrick::inline v0 {

/// Anything that stops a command. The message is one line: what is wrong, where (file, offset,
/// brick) and what to do. The program prints it and exits with 1.
class ISOBRICK_API Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The request itself makes no sense (wrong option, wrong size for the
/// dimensions). The program prints it and exits with 2.
class ISOBRICK_API UsageError : public Error {
 public:
  using Error::Error;
};

/// Stored bytes are not what they must be: a checksum, a size or a field is
/// wrong. `verify` collects these; every other reader stops at the first.
class ISOBRICK_API DamageError : public Error {
 public:
  using Error::Error;
};

/// The user ended the program (see cancel.h) while it waited for input.
class ISOBRICK_API Cancelled : public Error {
 public:
  using Error::Error;
};

/// The operating system refuses a file, a folder or a device.
class ISOBRICK_API SystemError : public Error {
 public:
  /// `code` is a value of errno.
  SystemError(const std::string& message, int code) : Error(message), code_(code) {}
  /// The value of errno.
  int code() const { return code_; }

 private:
  int code_;
};

/// "cannot open 'path': Permission denied" for the given errno value.
ISOBRICK_API SystemError system_error(const std::string& what, const std::string& path,
                                      int errno_value);

}  // namespace isobrick

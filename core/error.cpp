#include <isobrick/error.h>

#include <system_error>

namespace isobrick::inline v0 {

SystemError system_error(const std::string& what, const std::string& path, int errno_value) {
  return {"cannot " + what + " '" + path + "': " + std::generic_category().message(errno_value),
          errno_value};
}

}  // namespace isobrick

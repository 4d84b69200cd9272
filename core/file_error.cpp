#include "core/file_error.h"

#include <filesystem>
#include <system_error>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

std::string error_message(const std::exception& error) {
  const auto* of_system = dynamic_cast<const std::system_error*>(&error);
  if (of_system != nullptr && of_system->code() == std::errc::resource_unavailable_try_again)
    return "no thread can be started: address space (ulimit -v) or processes (ulimit -u) are "
           "short; try fewer --threads";
  const auto* of_file = dynamic_cast<const std::filesystem::filesystem_error*>(&error);
  if (of_file == nullptr) return error.what();
  return system_error("use", of_file->path1().string(), of_file->code().value()).what();
}

}  // namespace isobrick

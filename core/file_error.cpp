#include "core/file_error.h"

#include <filesystem>

#include <isobrick/error.h>

namespace isobrick {

std::string error_message(const std::exception& error) {
  const auto* of_file = dynamic_cast<const std::filesystem::filesystem_error*>(&error);
  if (of_file == nullptr) return error.what();
  return system_error("use", of_file->path1().string(), of_file->code().value()).what();
}

}  // namespace isobrick

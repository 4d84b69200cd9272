#include <isobrick/selection.h>

#include <string_view>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

Index choose(const std::string& path, const char* option, Index count,
             std::optional<Index> chosen) {
  const std::string_view what = std::string_view(option) == "--time" ? "time" : "channel";
  const std::string has = "'" + path + "' has " + std::to_string(count) + ' ' + std::string(what);
  if (!chosen && count > 1)
    throw UsageError(has + "s: choose one with " + option + " 0 … " + std::to_string(count - 1));
  if (chosen && (*chosen < 0 || *chosen >= count))
    throw UsageError(has + (count == 1 ? ": " : "s: ") + option + ' ' + std::to_string(*chosen) +
                     " is not there");
  return chosen.value_or(0);
}

}  // namespace isobrick

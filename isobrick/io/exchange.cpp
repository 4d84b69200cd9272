#include "isobrick/io/exchange.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstdio>

#include "isobrick/core/error.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& a, const fs::path& b, int errno_value) {
  throw system_error(fmt::format("exchange '{}' with", a.string()), b.string(), errno_value);
}

}  // namespace

void exchange(const fs::path& a, const fs::path& b) {
  if (::renameat2(AT_FDCWD, a.c_str(), AT_FDCWD, b.c_str(), RENAME_EXCHANGE) == 0) return;
  if (errno != EINVAL && errno != ENOSYS) fail(a, b, errno);
  exchange_by_renames(a, b);
}

void exchange_by_renames(const fs::path& a, const fs::path& b) {
  const fs::path aside = b.string() + ".replaced";
  const std::array<std::pair<fs::path, fs::path>, 3> steps{{{b, aside}, {a, b}, {aside, a}}};
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (::rename(steps[i].first.c_str(), steps[i].second.c_str()) == 0) continue;
    const int why = errno;
    while (i-- > 0) (void)::rename(steps[i].second.c_str(), steps[i].first.c_str());
    fail(a, b, why);
  }
}

}  // namespace isobrick

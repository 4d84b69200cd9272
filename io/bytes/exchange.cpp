#include "io/bytes/exchange.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstdio>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& a, const fs::path& b, int errno_value) {
  throw system_error(fmt::format("exchange '{}' with", a.string()), b.string(), errno_value);
}

}  // namespace

void exchange(int folder, const fs::path& a, const fs::path& b) {
  if (::renameat2(folder, a.c_str(), folder, b.c_str(), RENAME_EXCHANGE) == 0) return;
  if (errno != EINVAL && errno != ENOSYS) fail(a, b, errno);
  exchange_by_renames(folder, a, b);
}

void exchange_by_renames(int folder, const fs::path& a, const fs::path& b) {
  const fs::path aside = set_aside_name(b);
  const std::array<std::pair<fs::path, fs::path>, 3> steps{{{b, aside}, {a, b}, {aside, a}}};
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const auto& [from, to] = steps[i];
    if (::renameat(folder, from.c_str(), folder, to.c_str()) == 0) continue;
    const int why = errno;
    while (i-- > 0)
      (void)::renameat(folder, steps[i].second.c_str(), folder, steps[i].first.c_str());
    fail(a, b, why);
  }
}

fs::path set_aside_name(const fs::path& path) { return path.string() + ".replaced"; }

}  // namespace isobrick

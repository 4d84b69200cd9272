#include "core/machine_memory.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <sstream>
#include <string>

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kNoLimit = std::numeric_limits<std::uint64_t>::max();

std::string text_of(const fs::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// The number in a file; kNoLimit for "max" and for a file that is not there.
std::uint64_t limit_in(const fs::path& file) {
  const std::string text = text_of(file);
  std::uint64_t limit = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), limit);
  return error == std::errc{} ? limit : kNoLimit;
}

/// The least limit of a group and of those around it, up to `root`.
std::uint64_t least_limit(const fs::path& root, fs::path group, const char* file) {
  std::uint64_t least = limit_in(root / file);
  for (; group.has_relative_path(); group = group.parent_path())
    least = std::min(least, limit_in(root / group.relative_path() / file));
  return least;
}

bool has_word(std::string_view list, std::string_view word) {
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    if (list.substr(begin, end - begin) == word) return true;
    begin = end + 1;
  }
  return false;
}

std::uint64_t resource_limit(int resource) {
  rlimit limit{};
  if (::getrlimit(static_cast<__rlimit_resource_t>(resource), &limit) != 0 ||
      limit.rlim_cur == RLIM_INFINITY)
    return kNoLimit;
  return limit.rlim_cur;
}

std::uint64_t physical_memory() {
  const long pages = ::sysconf(_SC_PHYS_PAGES), bytes = ::sysconf(_SC_PAGE_SIZE);
  if (pages <= 0 || bytes <= 0) return kNoLimit;
  return static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(bytes);
}

}  // namespace

std::uint64_t control_group_memory(std::string_view groups, std::string_view root) {
  std::uint64_t least = kNoLimit;
  std::istringstream lines{std::string(groups)};
  for (std::string line; std::getline(lines, line);) {
    // "0::/user.slice" of version 2, "9:memory:/docker/…" of version 1
    const auto first = line.find(':'), second = line.find(':', first + 1);
    if (first == line.npos || second == line.npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const fs::path group = line.substr(second + 1);
    if (controllers.empty())
      least = std::min(least, least_limit(root, group, "memory.max"));
    else if (has_word(controllers, "memory"))
      least =
          std::min(least, least_limit(fs::path(root) / "memory", group, "memory.limit_in_bytes"));
  }
  return least;
}

std::uint64_t allowed_memory() {
  return std::min({physical_memory(), resource_limit(RLIMIT_AS), resource_limit(RLIMIT_DATA),
                   control_group_memory(text_of("/proc/self/cgroup"), "/sys/fs/cgroup")});
}

std::uint64_t default_memory_budget(std::uint64_t allowed) {
  return std::max(allowed / 4, std::min(allowed / 2, std::uint64_t{1} << 30));
}

}  // namespace isobrick

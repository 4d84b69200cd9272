#pragma once

#include <cstdint>
#include <string_view>

namespace isobrick::inline v0 {

/// Bytes of memory that this process may use: what the machine has, or less where its control
/// group (version 1 or 2, with those around it) or a resource limit allows less.
std::uint64_t allowed_memory();

/// The budget of a command that is given none: a quarter of allowed_memory(), or half of it up to
/// 1 GiB.
std::uint64_t default_memory_budget(std::uint64_t allowed);

/// The least limit of memory along the control groups that `groups`, the text of
/// /proc/self/cgroup, names below `root` ("/sys/fs/cgroup"). The largest number where there is
/// none.
std::uint64_t control_group_memory(std::string_view groups, std::string_view root);

}  // namespace isobrick

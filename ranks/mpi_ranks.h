#pragma once

#include <memory>

#include "ranks/ranks.h"

namespace isobrick::inline v0 {

/// Initialises MPI; destroying what it returns finalises it. Throws Error where MPI does not allow
/// calls from several threads.
std::unique_ptr<Ranks> join_mpi();

}  // namespace isobrick

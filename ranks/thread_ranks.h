#pragma once

#include <functional>

#include "ranks/ranks.h"

namespace isobrick::inline v0 {

/// Calls work(ranks) for each of so many ranks that are threads of this process, and returns once
/// all have ended. Where one throws, the others throw Error at their next call of Ranks; what it
/// threw is thrown to the caller. Ranks::end_job() is not for them.
void run_on_threads(int size, const std::function<void(Ranks&)>& work);

}  // namespace isobrick

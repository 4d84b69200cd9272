#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "ranks/ranks.h"
#include "tools/console.h"
#include "tools/options.h"

// Commands that the ranks of an MPI job share. The first rank reports for all of them.

namespace isobrick::tools {

/// --mpi: whether a command shares its work where mpirun starts it.
void add_mpi(CLI::App* app, bool& shares);

/// The job that mpirun started this process for; null where it did not, or for this process alone.
/// From now on only the first rank writes results, notes and progress. Throws Error where there is
/// a job that cannot be joined.
Ranks* join_job(bool shares, Console& console);

/// The job that join_job() joined, or null.
Ranks* joined_job();

/// Gives a rank its share of the machine, of what was not given to it.
void share_machine(const Ranks& job, std::uint64_t& memory, int& threads);

/// Collective: adds "peak_resident_bytes" to a result, of a job the largest of its ranks, and then
/// "ranks". Without a job the process's own.
void add_peak(Ranks* job, nlohmann::ordered_json& result);

/// The command has ended well on this rank: waits for the others.
void leave_job();

/// The command has failed on this rank: ends the job. `report(prefix)` is called on the first rank
/// that fails; "rank 3: " is the prefix where the failure may be its alone.
[[noreturn]] void end_job(int exit_code, const std::function<void(const std::string&)>& report);

}  // namespace isobrick::tools

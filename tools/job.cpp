#include "tools/job.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <thread>

#include <fmt/format.h>
#include <tbb/info.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "core/machine_memory.h"
#include "tools/interrupt.h"

namespace isobrick::tools {
namespace {

/// How long a rank that failed waits for another one to end the job.
constexpr std::chrono::seconds kPatience{10};

std::unique_ptr<Ranks>& job() {
  static std::unique_ptr<Ranks> joined;
  return joined;
}

}  // namespace

void add_mpi(CLI::App* app, bool& shares) {
  add_parsed(
      app, shares,
      [](const std::string& text) {
        if (text != "auto" && text != "off")
          throw UsageError(fmt::format("--mpi is auto or off, and not '{}'", text));
        return text == "auto";
      },
      {"--mpi", "auto|off",
       "Share the work among all ranks that mpirun starts; off: each does all of it", "auto"});
}

Ranks* join_job(bool shares, Console& console) {
  if (!shares || launched_ranks() < 2) return nullptr;
  job() = join_ranks();
  if (job()->rank() > 0) {
    console.mute();
    mute_interrupts();
  }
  return job().get();
}

Ranks* joined_job() { return job().get(); }

void share_machine(const Ranks& ranks, std::uint64_t& memory, int& threads) {
  const int here = ranks.node_size();
  if (memory == default_memory_budget(allowed_memory())) memory /= static_cast<unsigned>(here);
  if (threads > 0) return;
  // Those that mpirun bound the rank to; where it bound none, not all cores for each.
  const auto cores = static_cast<int>(::sysconf(_SC_NPROCESSORS_ONLN));
  threads = std::clamp(cores / here, 1, tbb::info::default_concurrency());
}

void add_peak(Ranks* ranks, nlohmann::ordered_json& result) {
  struct OfRank {
    std::uint64_t peak, received;
  };
  OfRank largest{peak_resident_bytes(), 0};
  if (ranks == nullptr) {
    result["peak_resident_bytes"] = largest.peak;
    return;
  }
  const OfRank own{largest.peak, ranks->bytes_received()};
  for (const Ranks::Bytes& bytes : ranks->gather(std::as_bytes(std::span(&own, 1)))) {
    const OfRank other = to_items<OfRank>(bytes).front();
    largest = {std::max(largest.peak, other.peak), std::max(largest.received, other.received)};
  }
  result["ranks"] = {{"total", ranks->size()}, {"received_bytes", largest.received}};
  result["peak_resident_bytes"] = largest.peak;
}

void leave_job() { job().reset(); }

void end_job(int exit_code, const std::function<void(const std::string&)>& report) {
  Ranks& ranks = *job();
  // What is wrong with the arguments is wrong on every rank.
  if (ranks.next(0) == 0)
    report(exit_code == 2 ? "" : fmt::format("rank {}: ", ranks.rank()));
  else
    std::this_thread::sleep_for(kPatience);
  ranks.end_job(exit_code);
  std::abort();
}

}  // namespace isobrick::tools

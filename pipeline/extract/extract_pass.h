#pragma once

#include <cstddef>
#include <functional>
#include <span>

#include "pipeline/extract/backend_choice.h"

namespace isobrick::inline v0 {

/// Surfaces that are to be made, in their order: a request, a sink and a report for each.
struct PassSurfaces {
  PassRequests requests;
  std::span<MeshSink* const> sinks;
  std::span<ExtractReport> reports;

  PassSurfaces first(std::size_t count) const {
    return {requests.first(count), sinks.first(count), reports.first(count)};
  }
  PassSurfaces after(std::size_t count) const {
    return {requests.subspan(count), sinks.subspan(count), reports.subspan(count)};
  }
};

/// What the search for a pass's tiles cost.
void report_search(const TileStream& tiles, std::span<ExtractReport> reports);
/// What decoding a pass's bricks took.
void report_bricks(std::uint64_t bricks_read, std::uint64_t reads, double decode_seconds,
                   std::span<ExtractReport> reports);

/// Called with a surface's number and those of its tiles that are done.
using TilesDone = std::function<void(std::size_t surface, std::span<const TileWork> tiles)>;

/// Makes the surfaces of a backend, which are the first of `surfaces`, in one pass over the bricks
/// of their tiles. Adds to their reports what the pass and each of them took; the sinks have begun
/// and are not finished.
void run_pass(const StoreReader& store, const ExtractOptions& options, ChosenBackend& backend,
              const PassSurfaces& surfaces, const TilesDone& done);

}  // namespace isobrick

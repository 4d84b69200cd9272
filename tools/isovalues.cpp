#include "tools/isovalues.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::tools {
namespace {

/// The histogram that a store keeps, else one of as many bins.
Histogram histogram_of(const StoreReader& store, Progress& progress) {
  if (auto stored = stored_histogram(store)) return std::move(*stored);
  return histogram(store, progress, 1 << 16, true);
}

}  // namespace

std::vector<double> resolve_isovalues(const std::vector<IsovalueRequest>& requests,
                                      const StoreReader& store, Progress& progress) {
  Histogram samples;
  if (std::any_of(requests.begin(), requests.end(), needs_histogram))
    samples = histogram_of(store, progress);
  std::vector<double> isovalues;
  for (const IsovalueRequest& request : requests) {
    const double isovalue = resolve_isovalue(request, samples, store.info().type);
    const bool is_there =
        std::find(isovalues.begin(), isovalues.end(), isovalue) != isovalues.end();
    if (!is_there) isovalues.push_back(isovalue);
  }
  return isovalues;
}

std::optional<SuggestedIsovalue> suggest_isovalue_of(const StoreReader& store, Progress& progress) {
  return suggest_isovalue(store.info(), histogram_of(store, progress));
}

}  // namespace isobrick::tools

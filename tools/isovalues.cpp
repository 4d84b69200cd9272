#include "tools/isovalues.h"

#include <algorithm>

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::tools {
namespace {

/// As many bins as a store keeps.
constexpr int kBins = 1 << 16;

}  // namespace

std::vector<double> resolve_isovalues(const std::vector<IsovalueRequest>& requests,
                                      const StoreReader& store, Progress& progress) {
  Histogram samples;
  if (std::any_of(requests.begin(), requests.end(), needs_histogram))
    samples = histogram(store, progress, kBins, true);
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
  return suggest_isovalue(store.info(), histogram(store, progress, kBins, true));
}

}  // namespace isobrick::tools

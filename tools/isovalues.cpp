#include "tools/isovalues.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "pipeline/value_text.h"

namespace isobrick::tools {
namespace {

/// The histogram that a store keeps, else one of as many bins. A remark where the bins tell little
/// of the samples.
Histogram histogram_of(const StoreReader& store, Console& console) {
  auto stored = stored_histogram(store);
  Histogram samples =
      stored ? std::move(*stored) : histogram(store, console.progress(), 1 << 16, true);
  if (const auto far = far_value(samples)) {
    const std::string value = sample_text(*far, store.info().type);
    console.note(fmt::format(
        "the value {} lies far from all other samples, which makes the histogram coarse; "
        "if it stands for missing samples, add --nodata {}",
        value, value));
  }
  return samples;
}

}  // namespace

std::vector<double> resolve_isovalues(const std::vector<IsovalueRequest>& requests,
                                      const StoreReader& store, Console& console) {
  Histogram samples;
  if (std::any_of(requests.begin(), requests.end(), needs_histogram))
    samples = histogram_of(store, console);
  std::vector<double> isovalues;
  for (const IsovalueRequest& request : requests) {
    const double isovalue = resolve_isovalue(request, samples, store.info().type);
    const bool is_there =
        std::find(isovalues.begin(), isovalues.end(), isovalue) != isovalues.end();
    if (!is_there) isovalues.push_back(isovalue);
  }
  return isovalues;
}

std::optional<SuggestedIsovalue> suggest_isovalue_of(const StoreReader& store, Console& console) {
  return suggest_isovalue(store.info(), histogram_of(store, console));
}

}  // namespace isobrick::tools

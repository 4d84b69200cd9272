#include "tools/isovalues.h"

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
  return isobrick::resolve_isovalues(requests, store.info().type,
                                     [&] { return histogram_of(store, console); });
}

std::optional<SuggestedIsovalue> suggest_isovalue_of(const StoreReader& store, Console& console) {
  return suggest_isovalue(store.info(), histogram_of(store, console));
}

}  // namespace isobrick::tools

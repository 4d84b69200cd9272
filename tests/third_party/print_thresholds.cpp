// print_thresholds STORE PERCENT...
// Prints the histogram that a store keeps, Otsu's threshold and the percentiles, as JSON.

#include <cstdlib>
#include <iostream>

#include <nlohmann/json.hpp>

#include <isobrick/histogram.h>

namespace {

nlohmann::json or_null(const std::optional<double>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return EXIT_FAILURE;
  const isobrick::StoreReader store(argv[1]);
  const auto h = isobrick::stored_histogram(store);
  if (!h) return EXIT_FAILURE;
  nlohmann::json json{{"first", h->first},
                      {"bin_width", h->bin_width},
                      {"counts", h->counts},
                      {"otsu", or_null(isobrick::otsu(*h))},
                      {"percentiles", nlohmann::json::array()}};
  for (int i = 2; i < argc; ++i)
    json["percentiles"].push_back(or_null(isobrick::percentile(*h, std::strtod(argv[i], nullptr))));
  std::cout << json << "\n";
  return EXIT_SUCCESS;
}

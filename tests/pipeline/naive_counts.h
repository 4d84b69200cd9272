#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <span>
#include <vector>

#include <isobrick/scalar.h>
#include "bricks/ranges/stored_histogram.h"

namespace isobrick::test {

/// The bin of a value by the definition, in numbers with room for every quotient.
inline std::int64_t naive_bin(double value, int exponent) {
  return static_cast<std::int64_t>(
      std::floor(std::ldexp(static_cast<long double>(value), -exponent)));
}

/// The counts of samples by their definition, one sample after the other.
template <class T>
SampleCounts naive_counts(std::span<const T> samples) {
  SampleCounts counts;
  HistogramBins& bins = counts.bins;
  std::vector<double> finite;
  for (const T sample : samples) {
    const auto value = static_cast<double>(sample);
    if (std::isfinite(value))
      finite.push_back(value + 0.0);
    else
      ++(std::isnan(value) ? bins.not_a_number : bins.infinite);
  }
  if (finite.empty()) return counts;
  bins.lo = *std::min_element(finite.begin(), finite.end());
  bins.hi = *std::max_element(finite.begin(), finite.end());
  const double largest = std::max(std::abs(bins.lo), std::abs(bins.hi));
  const bool floating = std::is_floating_point_v<T>;
  bins.exponent = !floating ? 0 : sizeof(T) == 4 ? -126 : -1000;
  const auto fits = [&] {
    // No narrower than the largest values are apart.
    if (floating && std::ldexp(static_cast<long double>(largest), -bins.exponent) >=
                        std::ldexp(1.0L, std::numeric_limits<T>::digits))
      return false;
    return naive_bin(bins.hi, bins.exponent) - naive_bin(bins.lo, bins.exponent) <
           kMaxHistogramBins;
  };
  while (!fits()) ++bins.exponent;
  bins.first = naive_bin(bins.lo, bins.exponent);
  bins.count = naive_bin(bins.hi, bins.exponent) - bins.first + 1;
  counts.counts.resize(static_cast<std::size_t>(bins.count));
  for (const double value : finite)
    ++counts.counts[static_cast<std::size_t>(naive_bin(value, bins.exponent) - bins.first)];
  return counts;
}

/// The same of samples as bytes.
inline SampleCounts naive_counts(ScalarType type, std::span<const std::byte> bytes) {
  return visit_sample(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    std::vector<T> samples(bytes.size() / sizeof(T));
    std::memcpy(samples.data(), bytes.data(), bytes.size());
    return naive_counts<T>(samples);
  });
}

}  // namespace isobrick::test

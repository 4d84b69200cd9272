#pragma once

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <isobrick/scalar.h>
#include <isobrick/vec.h>

namespace isobrick::test {

/// Kinds of samples that a codec meets, or must not fail at.
inline const std::vector<std::string> kFields = {"constant", "smooth", "noise",  "noisy",
                                                 "sparse",   "labels", "border", "extremes"};

/// Samples of such a field at x, y, z.
template <class T>
class Field {
 public:
  Field(const std::string& kind, unsigned seed) : kind_(kind), random_(seed) {}

  T at(Int3 p) {
    const double wave = std::sin(0.07 * static_cast<double>(p.x)) *
                        std::cos(0.05 * static_cast<double>(p.y) + 0.09 * static_cast<double>(p.z));
    if (kind_ == "constant") return static_cast<T>(3);
    if (kind_ == "smooth") return static_cast<T>(60 + 50 * wave);
    if (kind_ == "noisy")
      return static_cast<T>(60 + 50 * wave + static_cast<double>(random_() % 7));
    if (kind_ == "sparse") return static_cast<T>(random_() % 200 == 0 ? random_() % 100 : 0u);
    if (kind_ == "labels") return static_cast<T>((p.x / 9 + p.y / 11 * 5 + p.z / 13 * 17) % 3 * 40);
    if (kind_ == "border") return static_cast<T>(p.x < 11 || p.y > 13 ? 0 : 90);
    if (kind_ == "extremes") return extreme();
    return any();
  }

 private:
  /// Any bits at all: of floating-point numbers also NaN with a payload.
  T any() {
    const std::uint64_t bits = std::uint64_t{random_()} << 32 | random_();
    T value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }
  T extreme() {
    using Limits = std::numeric_limits<T>;
    switch (random_() % 5) {
      case 0: return Limits::lowest();
      case 1: return Limits::max();
      case 2: return Limits::has_infinity ? -Limits::infinity() : T(1);
      case 3: return Limits::has_quiet_NaN ? Limits::quiet_NaN() : T(2);
      default: return static_cast<T>(-0.0);
    }
  }

  std::string kind_;
  std::mt19937 random_;
};

/// A brick of such samples.
inline std::vector<std::byte> make_brick(ScalarType type, Int3 extent, const std::string& kind,
                                         unsigned seed = 1) {
  return visit_sample(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    std::vector<T> samples;
    Field<T> field(kind, seed);
    for (Index z = 0; z < extent.z; ++z)
      for (Index y = 0; y < extent.y; ++y)
        for (Index x = 0; x < extent.x; ++x) samples.push_back(field.at({x, y, z}));
    std::vector<std::byte> bytes(samples.size() * sizeof(T));
    std::memcpy(bytes.data(), samples.data(), bytes.size());
    return bytes;
  });
}

}  // namespace isobrick::test

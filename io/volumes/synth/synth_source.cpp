#include <isobrick/synth_source.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/lattice.h>
#include "io/volumes/synth/synth_cells.h"
#include "io/volumes/synth/synth_field.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::string_view kNames[] = {"sphere", "gyroid", "marschner-lobb", "mixing", "cells"};
constexpr SynthKind kKinds[] = {SynthKind::sphere, SynthKind::gyroid, SynthKind::marschner_lobb,
                                SynthKind::mixing, SynthKind::cells};

/// float where it resolves all of the type's values.
template <class T>
using RealFor = std::conditional_t<std::is_same_v<T, float> || sizeof(T) <= 2, float, double>;

template <class T>
void quantize(const RealFor<T>* field, std::size_t n, std::byte* bytes) {
  using Real = RealFor<T>;
  if constexpr (std::is_floating_point_v<T>) {
    std::memcpy(bytes, field, n * sizeof(T));
  } else {
    using Wide = std::conditional_t<sizeof(T) == 4, std::int64_t, std::int32_t>;
    constexpr Real half =
        static_cast<Real>(std::numeric_limits<std::make_unsigned_t<T>>::max()) / 2;
    constexpr auto lowest = static_cast<Wide>(std::numeric_limits<T>::lowest());
    for (std::size_t i = 0; i < n; ++i) {
      Real f = field[i];
      f = f < Real{-1} ? Real{-1} : f;
      f = f > Real{1} ? Real{1} : f;
      // Never negative, so truncation rounds to nearest.
      const auto sample = static_cast<T>(static_cast<Wide>(f * half + (half + Real{0.5})) + lowest);
      std::memcpy(bytes + i * sizeof(T), &sample, sizeof(T));
    }
  }
}

class SynthSource final : public VolumeSource {
 public:
  explicit SynthSource(const SynthOptions& options) : options_(options) {
    info_.extent = options.extent;
    info_.type = options.type;
    info_.name = name_of(options.kind);
    if (options.kind == SynthKind::cells) info_.labels.emplace();
  }

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }

  void read(Box3 box, std::byte* out) override {
    if (box.empty()) return;
    visit_sample(options_.type, [&](auto tag) {
      using T = typename decltype(tag)::type;
      if (options_.kind == SynthKind::cells) fill_labels<T>(box, out);
      if constexpr (sizeof(T) < 8 || std::is_floating_point_v<T>)
        if (options_.kind != SynthKind::cells) fill<T>(box, out);
    });
  }

 private:
  template <class T>
  void fill(Box3 box, std::byte* out) const {
    using Real = RealFor<T>;
    const auto field = make_synth_field<Real>(options_, box);
    const Int3 size = box.extent();
    std::vector<Real> row(static_cast<std::size_t>(size.x));
    // y outside: some fields keep what depends on x and y.
    for (Index y = box.lo.y; y < box.hi.y; ++y)
      for (Index z = box.lo.z; z < box.hi.z; ++z) {
        field->row(y, z, row.data());
        const Index at = linear_index({0, y - box.lo.y, z - box.lo.z}, size);
        quantize<T>(row.data(), row.size(), out + static_cast<std::size_t>(at) * sizeof(T));
      }
  }

  template <class T>
  void fill_labels(Box3 box, std::byte* out) const {
    SynthCells cells(options_, box);
    std::vector<std::uint32_t> row(static_cast<std::size_t>(box.extent().x));
    for (Index z = box.lo.z; z < box.hi.z; ++z)
      for (Index y = box.lo.y; y < box.hi.y; ++y) {
        cells.row(y, z, row.data());
        for (const std::uint32_t label : row) {
          const auto sample = static_cast<T>(label);
          std::memcpy(out, &sample, sizeof(T));
          out += sizeof(T);
        }
      }
  }

  SynthOptions options_;
  VolumeInfo info_;
};

/// Throws UsageError where the type has no room for the labels.
void check_cells(const SynthOptions& options) {
  const double labels = SynthCells::max_label(options);
  const double most = visit_sample(options.type, [](auto tag) {
    using Limits = std::numeric_limits<typename decltype(tag)::type>;
    return Limits::is_integer ? static_cast<double>(Limits::max())
                              : std::ldexp(1.0, Limits::digits);
  });
  if (labels > std::min(most, 4294967295.0))
    throw UsageError(fmt::format(
        "{:.0f} labels are too many for samples of type {}: choose a larger type or a smaller "
        "frequency",
        labels, short_name(options.type)));
}

double default_frequency(SynthKind kind) {
  return kind == SynthKind::mixing ? 6.0 : kind == SynthKind::cells ? 5.0 : 2.0;
}

}  // namespace

std::string_view name_of(SynthKind kind) { return kNames[static_cast<int>(kind)]; }

std::optional<SynthKind> parse_synth_kind(std::string_view name) {
  for (const SynthKind kind : kKinds)
    if (name == name_of(kind)) return kind;
  return std::nullopt;
}

double default_isovalue(ScalarType type) {
  return visit_sample(type, [](auto tag) {
    using Limits = std::numeric_limits<typename decltype(tag)::type>;
    if constexpr (Limits::is_integer)
      return (static_cast<double>(Limits::lowest()) + static_cast<double>(Limits::max())) / 2;
    else
      return 0.0;
  });
}

std::unique_ptr<VolumeSource> make_synth(const SynthOptions& options) {
  if (!checked_volume(options.extent))
    throw UsageError(fmt::format("an extent of {}x{}x{} samples is not positive or too large",
                                 options.extent.x, options.extent.y, options.extent.z));
  const Int3 e = options.extent;
  // Finer structure than this is not structure any more.
  const double finest = std::max(2.0, static_cast<double>(std::max({e.x, e.y, e.z})));
  SynthOptions complete = options;
  if (!complete.frequency) complete.frequency = std::min(default_frequency(options.kind), finest);
  if (!(*complete.frequency > 0 && *complete.frequency <= finest))
    throw UsageError(fmt::format("a frequency of {} is not between 0 and the longest edge",
                                 *complete.frequency));
  if (!std::isfinite(options.noise) || options.noise < 0)
    throw UsageError("the noise is negative or not a number");
  if (options.kind == SynthKind::cells)
    check_cells(complete);
  else if (is_wide_integer(options.type))
    throw UsageError(fmt::format("samples of type {} are labels, and {} has none: choose cells",
                                 short_name(options.type), name_of(options.kind)));
  return std::make_unique<SynthSource>(complete);
}

}  // namespace isobrick

#include "io/volumes/synth/synth_field.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "io/volumes/synth/synth_math.h"

namespace isobrick::inline v0 {
namespace {

/// f(i) for i in [lo, hi), computed in double.
template <class Real, class F>
std::vector<Real> tabulate(Index lo, Index hi, F&& f) {
  std::vector<Real> table;
  table.reserve(static_cast<std::size_t>(hi - lo));
  for (Index i = lo; i < hi; ++i) table.push_back(static_cast<Real>(f(static_cast<double>(i))));
  return table;
}

double centre(Index extent) { return 0.5 * static_cast<double>(extent - 1); }

Index longest(Int3 e) { return std::max({e.x, e.y, e.z}); }
Index shortest(Int3 e) { return std::min({e.x, e.y, e.z}); }

template <class Real>
class Sphere final : public SynthField<Real> {
 public:
  Sphere(const SynthOptions& options, Box3 box) : options_(options) {
    const double c = centre(options.extent.x);
    x2_ = tabulate<Real>(box.lo.x, box.hi.x, [c](double x) { return (x - c) * (x - c); });
    const double radius = 0.4 * static_cast<double>(shortest(options.extent));
    // A rim of limited width keeps the surface smooth in 8 bits at any size.
    const double rim = std::clamp(radius, 1.0, 32.0);
    radius_ = static_cast<Real>(radius / rim);
    scale_ = static_cast<Real>(1 / rim);
  }

  void row(Index y, Index z, Real* out) override {
    const double dy = static_cast<double>(y) - centre(options_.extent.y);
    const double dz = static_cast<double>(z) - centre(options_.extent.z);
    const auto yz2 = static_cast<Real>(dy * dy + dz * dz);
    const Real radius = radius_, scale = scale_;
    const Real* x2 = x2_.data();
    const std::size_t n = x2_.size();
    for (std::size_t i = 0; i < n; ++i) out[i] = radius - std::sqrt(x2[i] + yz2) * scale;
  }

 private:
  SynthOptions options_;
  std::vector<Real> x2_;
  Real radius_, scale_;
};

template <class Real>
class Gyroid final : public SynthField<Real> {
 public:
  Gyroid(const SynthOptions& options, Box3 box)
      : options_(options),
        box_(box),
        step_(*options.frequency / static_cast<double>(longest(options.extent))) {
    // ⅔: the field reaches from −1.5 to 1.5.
    sin_x_ = tabulate<Real>(box.lo.x, box.hi.x,
                            [this](double x) { return sin_turns(x * step_) * (2.0 / 3.0); });
    cos_x_ = tabulate<Real>(box.lo.x, box.hi.x,
                            [this](double x) { return cos_turns(x * step_) * (2.0 / 3.0); });
  }

  void row(Index y, Index z, Real* out) override {
    const double ty = static_cast<double>(y) * step_, tz = static_cast<double>(z) * step_;
    const auto cos_y = static_cast<Real>(cos_turns(ty));
    const auto sin_z = static_cast<Real>(sin_turns(tz));
    const auto rest = static_cast<Real>(sin_turns(ty) * cos_turns(tz) * (2.0 / 3.0));
    const auto noise = static_cast<Real>(options_.noise);
    const std::uint32_t key = row_key(options_.seed, y, z);
    const auto x0 = static_cast<std::uint32_t>(box_.lo.x);
    const Real *sin_x = sin_x_.data(), *cos_x = cos_x_.data();
    const auto n = static_cast<std::uint32_t>(sin_x_.size());
    for (std::uint32_t i = 0; i < n; ++i)
      out[i] = sin_x[i] * cos_y + cos_x[i] * sin_z + rest +
               signed_unit<Real>(scramble(key + x0 + i)) * noise;
  }

 private:
  SynthOptions options_;
  Box3 box_;
  double step_;  ///< turns a sample
  std::vector<Real> sin_x_, cos_x_;
};

template <class Real>
class MarschnerLobb final : public SynthField<Real> {
 public:
  MarschnerLobb(const SynthOptions& options, Box3 box)
      : extent_(options.extent), box_(box), radial_(static_cast<std::size_t>(box.extent().x)) {}

  void row(Index y, Index z, Real* out) override {
    if (y != radial_y_) make_radial(y);
    // ρ = (1 − sin(πz/2) + α(1 + ρ_r)) / (2(1 + α)) from [0, 1] to [−1, 1].
    const auto along_z = static_cast<Real>(-sin_turns(unit(z, extent_.z) * 0.25) / (1 + kAlpha));
    for (const Real radial : radial_) *out++ = along_z + radial;
  }

 private:
  static constexpr double kAlpha = 0.25, kFrequency = 6;

  static double unit(Index i, Index extent) {
    return extent > 1 ? 2 * static_cast<double>(i) / static_cast<double>(extent - 1) - 1 : 0.0;
  }

  void make_radial(Index y) {
    const double uy = unit(y, extent_.y);
    for (std::size_t i = 0; i < radial_.size(); ++i) {
      const double ux = unit(box_.lo.x + static_cast<Index>(i), extent_.x);
      const double r = std::sqrt(ux * ux + uy * uy);
      const double wave = cos_turns(kFrequency * cos_turns(r * 0.25));
      radial_[i] = static_cast<Real>(kAlpha * wave / (1 + kAlpha));
    }
    radial_y_ = y;
  }

  Int3 extent_;
  Box3 box_;
  Index radial_y_ = -1;
  std::vector<Real> radial_;
};

/// Value noise on a lattice, interpolated smoothly; rows share everything that
/// depends on x alone.
template <class Real>
class NoiseOctave {
 public:
  NoiseOctave(std::uint64_t seed, double cell, Real amplitude, Box3 box)
      : seed_(seed), cell_(cell), amplitude_(amplitude) {
    for (Index x = box.lo.x; x < box.hi.x; ++x) {
      const auto [corner, weight] = locate(x);
      if (runs_.empty() || runs_.back().corner != corner)
        runs_.push_back({corner, 0, !runs_.empty() && runs_.back().corner + 1 == corner});
      ++runs_.back().length;
      weights_.push_back(static_cast<Real>(weight));
    }
  }

  /// Adds the row (y, z) to `out`.
  void add(Index y, Index z, Real* out) const {
    const auto [cy, wy] = locate(y);
    const auto [cz, wz] = locate(z);
    const std::uint32_t keys[4] = {row_key(seed_, cy, cz), row_key(seed_, cy + 1, cz),
                                   row_key(seed_, cy, cz + 1), row_key(seed_, cy + 1, cz + 1)};
    const auto value = [&, wy = static_cast<Real>(wy), wz = static_cast<Real>(wz)](Index x) {
      Real v[4];
      for (int i = 0; i < 4; ++i)
        v[i] = signed_unit<Real>(scramble(keys[i] + static_cast<std::uint32_t>(x)));
      const Real near = v[0] + (v[1] - v[0]) * wy, far = v[2] + (v[3] - v[2]) * wy;
      return (near + (far - near) * wz) * amplitude_;
    };
    const Real* weight = weights_.data();
    Real to = 0;
    for (const Run& run : runs_) {
      // Runs follow one another: the end of one is the start of the next,
      // unless cells are smaller than a sample.
      const Real from = run.adjoins_last ? to : value(run.corner);
      to = value(run.corner + 1);
      const Real step = to - from;
      for (std::size_t i = 0; i < run.length; ++i) out[i] += from + step * weight[i];
      out += run.length;
      weight += run.length;
    }
  }

 private:
  struct Place {
    Index corner;
    double weight;
  };
  struct Run {
    Index corner;
    std::size_t length;
    bool adjoins_last;
  };

  Place locate(Index i) const {
    const double at = static_cast<double>(i) / cell_;
    const double corner = std::floor(at);
    const double t = at - corner;
    return {static_cast<Index>(corner), t * t * t * (t * (t * 6 - 15) + 10)};
  }

  std::uint64_t seed_;
  double cell_;
  Real amplitude_;
  std::vector<Run> runs_;
  std::vector<Real> weights_;
};

template <class Real>
class MixingLayer final : public SynthField<Real> {
 public:
  MixingLayer(const SynthOptions& options, Box3 box)
      : extent_(options.extent), width_(static_cast<std::size_t>(box.extent().x)) {
    double cell = static_cast<double>(longest(extent_)) / *options.frequency;
    double amplitude = 1;
    // Down to eddies that a few samples can still show.
    for (std::uint64_t octave = 0; octave < 7 && (octave == 0 || cell >= 4); ++octave) {
      octaves_.emplace_back(options.seed + octave, cell, static_cast<Real>(amplitude), box);
      cell *= 0.5;
      amplitude *= 0.6;
    }
  }

  void row(Index y, Index z, Real* out) override {
    const double height =
        (static_cast<double>(z) - centre(extent_.z)) / static_cast<double>(extent_.z);
    const double inside = 1 - height * height / (kLayer * kLayer);
    if (inside <= 0) {
      std::fill_n(out, width_, static_cast<Real>(height > 0 ? 1 : -1));
      return;
    }
    std::fill_n(out, width_, Real{0});
    for (const auto& octave : octaves_) octave.add(y, z, out);
    const auto mean = static_cast<Real>(height / kWidth);
    const auto stir = static_cast<Real>(inside * inside * kStir / kWidth);
    for (std::size_t i = 0; i < width_; ++i) {
      Real t = mean + stir * out[i];
      t = t < Real{-1} ? Real{-1} : t;
      t = t > Real{1} ? Real{1} : t;
      out[i] = t * (Real{1.5} - Real{0.5} * t * t);
    }
  }

 private:
  // As parts of the height: half of the layer that is stirred, half of the
  // interface's width at rest, and how far the largest eddies reach.
  static constexpr double kLayer = 0.3, kWidth = 0.06, kStir = 0.2;

  Int3 extent_;
  std::size_t width_;
  std::vector<NoiseOctave<Real>> octaves_;
};

}  // namespace

template <class Real>
std::unique_ptr<SynthField<Real>> make_synth_field(const SynthOptions& options, Box3 box) {
  switch (options.kind) {
    case SynthKind::sphere: return std::make_unique<Sphere<Real>>(options, box);
    case SynthKind::gyroid: return std::make_unique<Gyroid<Real>>(options, box);
    case SynthKind::marschner_lobb: return std::make_unique<MarschnerLobb<Real>>(options, box);
    case SynthKind::mixing: return std::make_unique<MixingLayer<Real>>(options, box);
    case SynthKind::cells: break;
  }
  throw std::logic_error("cells are labels and no field");
}

template std::unique_ptr<SynthField<float>> make_synth_field(const SynthOptions&, Box3);
template std::unique_ptr<SynthField<double>> make_synth_field(const SynthOptions&, Box3);

}  // namespace isobrick

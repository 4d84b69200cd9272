#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

namespace isobrick {

/// Keeps frames within a time limit while something moves, by previews. The rule is fixed: a
/// preview that took longer makes the next one a step simpler, one that left a quarter of the
/// limit makes it a step finer. The steps down are: no occlusion and multisampling, half the
/// triangles, a smaller picture, and at last half the triangles again. Occlusion and multisampling
/// come back with the next picture at rest that leaves time for them.
///
/// Thin structure that coarse levels have lost may take kThinTimes the limit: a preview in which it
/// took longer makes the next one as small as can be, and if that does not help it gets fewer
/// triangles, as many as the time lasts for. Not thread-safe.
class FramePacer {
 public:
  static constexpr std::uint64_t kAllTriangles = std::numeric_limits<std::uint64_t>::max();
  /// The most that previews may have for thin structure, and in how many times the limit.
  static constexpr std::uint64_t kThinTriangles = 600'000;
  static constexpr double kThinTimes = 4;

  /// `limit`: how long a picture may take while something moves, seconds.
  explicit FramePacer(double limit = kSoftwareLimit) : limit_(limit) {}

  /// For a store that has just been opened. Software begins with simple pictures.
  static FramePacer for_device(bool software) {
    FramePacer pacer(software ? kSoftwareLimit : kDeviceLimit);
    if (!software) return pacer;
    pacer.reduced_quality_ = true;
    pacer.triangles_ = kFirstInSoftware;
    return pacer;
  }

  /// A picture of all triangles, in full, that took `seconds` while nothing moved: the first
  /// preview is then fluent as well.
  void add_still(double seconds, std::uint64_t triangles) {
    const double full = kFull * limit_;  // a preview chooses nodes and takes meshes over, too
    reduced_quality_ = seconds > full;
    triangles_ = seconds > limit_
                     ? std::max(static_cast<double>(triangles) * full / seconds, kMinTriangles)
                     : kUnlimited;
  }

  /// A preview that took `seconds` to draw as plain(), max_triangles() and size_divisor() returned.
  /// `limited`: with more triangles it would be finer. `thin`: it had more than max_triangles(),
  /// for thin structure.
  void add_preview(double seconds, std::uint64_t triangles, bool limited, bool thin = false) {
    pace_thin(seconds, static_cast<double>(triangles), limited, thin);
    if (seconds > limit_)
      simplify(std::min(triangles_, static_cast<double>(triangles)));
    else if (seconds < kFull * limit_)
      refine(seconds, limited);
  }

  /// Whether to leave occlusion and multisampling out while something moves.
  bool reduces_quality() const { return reduced_quality_; }
  /// Of a preview.
  std::uint64_t max_triangles() const {
    return triangles_ < kUnlimited ? static_cast<std::uint64_t>(triangles_) : kAllTriangles;
  }
  /// Of a preview that needs more than max_triangles() for thin structure.
  std::uint64_t thin_triangles() const { return static_cast<std::uint64_t>(thin_triangles_); }
  /// Divisor of the picture's width and height while something moves. At rest: 1.
  int size_divisor() const { return size_divisor_; }

 private:
  /// A device leaves a part of a display's period of 16.7 ms, since single frames take longer.
  static constexpr double kDeviceLimit = 0.0125, kSoftwareLimit = 0.045;
  static constexpr double kUnlimited = 1e12;
  static constexpr double kFirstInSoftware = 60'000;
  /// Before previews become smaller, and at the very least.
  static constexpr double kFewTriangles = 40'000, kMinTriangles = 2'000;
  /// Of the limit: a preview that takes between kFull and 1 is left as it is.
  static constexpr double kFull = 0.75;
  static constexpr double kGrowth = 1.2;
  static constexpr int kMaxSizeDivisor = 4;

  void simplify(double triangles) {
    const bool smallest = size_divisor_ == kMaxSizeDivisor;
    if (!reduced_quality_)
      reduced_quality_ = true;
    else if (triangles > kFewTriangles || smallest)
      triangles_ = std::max(triangles / 2, smallest ? kMinTriangles : kFewTriangles);
    else
      ++size_divisor_;
  }

  void refine(double seconds, bool limited) {
    const double larger =
        size_divisor_ > 1 ? static_cast<double>(size_divisor_) / (size_divisor_ - 1) : 1;
    if (size_divisor_ > 1 && triangles_ >= kFewTriangles &&
        seconds * larger * larger < kFull * limit_)
      --size_divisor_;
    else if (limited)
      triangles_ *= kGrowth;
  }

  void pace_thin(double seconds, double triangles, bool limited, bool thin) {
    const double most = kThinTimes * limit_;
    const double fitting = triangles * kFull * most / seconds;
    if (thin && seconds > most) {
      if (size_divisor_ == kMaxSizeDivisor) thin_triangles_ = std::max(fitting, kMinTriangles);
      reduced_quality_ = true;
      size_divisor_ = kMaxSizeDivisor;
    } else if (limited && fitting > thin_triangles_) {
      thin_triangles_ =
          std::min({fitting, kGrowth * thin_triangles_, static_cast<double>(kThinTriangles)});
    }
  }

  double limit_;
  double triangles_ = kUnlimited;
  double thin_triangles_ = kThinTriangles;
  int size_divisor_ = 1;
  bool reduced_quality_ = false;
};

}  // namespace isobrick

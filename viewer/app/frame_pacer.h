#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

namespace isobrick::inline v0 {

/// Keeps frames within a time limit during motion, by previews. A preview that exceeds the limit
/// makes the next one a step coarser; one that leaves a quarter of the limit makes it a step finer.
/// The steps are: no occlusion and multisampling, half the triangles, a smaller picture, and
/// finally half the triangles again. Occlusion and multisampling return after a still frame that
/// leaves time for them.
///
/// Thin structure that coarse levels have lost may take kThinTimes the limit. If it exceeds that,
/// the next preview has the smallest size; if that does not suffice, fewer triangles. Not
/// thread-safe.
class FramePacer {
 public:
  static constexpr std::uint64_t kAllTriangles = std::numeric_limits<std::uint64_t>::max();
  /// Maximum triangles of previews with thin structure, and multiple of the limit for them.
  static constexpr std::uint64_t kThinTriangles = 600'000;
  static constexpr double kThinTimes = 4;

  /// `limit`: seconds for a frame during motion.
  explicit FramePacer(double limit = kSoftwareLimit) : limit_(limit) {}

  /// The pacer for a newly opened store. Software starts with coarse previews.
  static FramePacer for_device(bool software) {
    FramePacer pacer(software ? kSoftwareLimit : kDeviceLimit);
    if (!software) return pacer;
    pacer.reduced_quality_ = true;
    pacer.triangles_ = kFirstInSoftware;
    return pacer;
  }

  /// Reports a still frame in full quality with all triangles, which took `seconds`. The first
  /// preview is set to meet the limit, too.
  void add_still(double seconds, std::uint64_t triangles) {
    const double full = kFull * limit_;  // a preview also chooses nodes and uploads meshes
    reduced_quality_ = seconds > full;
    triangles_ = seconds > limit_
                     ? std::max(static_cast<double>(triangles) * full / seconds, kMinTriangles)
                     : kUnlimited;
  }

  /// Reports a preview with the present settings, which took `seconds`. `limited`: more triangles
  /// would make it finer. `thin`: it exceeded max_triangles() for thin structure.
  void add_preview(double seconds, std::uint64_t triangles, bool limited, bool thin = false) {
    pace_thin(seconds, static_cast<double>(triangles), limited, thin);
    if (seconds > limit_)
      simplify(std::min(triangles_, static_cast<double>(triangles)));
    else if (seconds < kFull * limit_)
      refine(seconds, limited);
  }

  /// Whether to leave out occlusion and multisampling during motion.
  bool reduces_quality() const { return reduced_quality_; }
  /// Maximum triangles of a preview.
  std::uint64_t max_triangles() const {
    return triangles_ < kUnlimited ? static_cast<std::uint64_t>(triangles_) : kAllTriangles;
  }
  /// Maximum triangles of a preview with thin structure.
  std::uint64_t thin_triangles() const { return static_cast<std::uint64_t>(thin_triangles_); }
  /// Divisor of the picture's width and height during motion.
  int size_divisor() const { return size_divisor_; }

 private:
  /// A device leaves a part of the display's period of 16.7 ms, since frame times vary.
  static constexpr double kDeviceLimit = 0.0125, kSoftwareLimit = 0.045;
  static constexpr double kUnlimited = 1e12;
  static constexpr double kFirstInSoftware = 60'000;
  /// Triangles below which the size is reduced first; and the minimum.
  static constexpr double kFewTriangles = 40'000, kMinTriangles = 2'000;
  /// Fraction of the limit: a preview between kFull and 1 changes nothing.
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
    const double max_seconds = kThinTimes * limit_;
    const double fitting = triangles * kFull * max_seconds / seconds;
    if (thin && seconds > max_seconds) {
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

#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

namespace isobrick {

/// Keeps pictures fluent while something moves by asking for previews: first without occlusion and
/// multisampling, then with as many triangles as there is time for, then smaller, which is what
/// helps where OpenGL is software, at last with still fewer triangles. Where a device draws, all
/// that comes before smaller ones: it gets other memory for another size, which takes longer than
/// a picture may. Not thread-safe.
class FramePacer {
 public:
  static constexpr std::uint64_t kAllTriangles = std::numeric_limits<std::uint64_t>::max();

  /// `target`: how long a picture may take while something moves, seconds.
  explicit FramePacer(double target = 1.0 / 20) : target_(target) {}

  /// For a store that has just been opened: 20 pictures a second in software, which begins with
  /// simple ones; as many as displays show where a device draws.
  static FramePacer for_device(bool software) {
    FramePacer pacer(software ? 1.0 / 20 : 1.0 / 80);
    if (!software) {
      pacer.few_ = kFewest;
      return pacer;
    }
    pacer.plain_ = true;
    pacer.until_try_ = kShortestPause;
    pacer.rest_ = pacer.rest_before_ = pacer.target_;  // a pixel takes long there
    pacer.triangles_ = kFirstInSoftware;
    return pacer;
  }

  /// A picture of all triangles, in full, that took `seconds` while nothing moved: the first
  /// preview is then fluent as well.
  void drawn_still(double seconds, std::uint64_t triangles) {
    if (seconds < kNothingDrawn) return;
    const double ratio = seconds / target_;
    last_plain_ = 0;
    // While something changes there is more to do than to draw.
    plain_ = ratio > kLeisure;
    if (plain_) until_try_ = ratio > kMostWithRest ? pause_ : kShortestPause;
    triangles_ = std::numeric_limits<double>::infinity();
    if (ratio > kAim) triangles_ = std::max(static_cast<double>(triangles) * kAim / ratio, kFewest);
  }

  /// A preview that took `seconds` to draw as plain(), max_triangles() and smaller() say now.
  /// `limited`: with more of them it would be finer.
  void drawn(double seconds, std::uint64_t triangles, bool limited) {
    const double ratio = seconds / target_;
    if (!plain_)
      learn_rest(seconds);
    else if (!limited && smaller_ == 1)
      last_plain_ = seconds;
    if (!plain_ && ratio > kMostWithRest) {
      leave_rest_out();
      return;
    }
    if (!plain_) pause_ = std::max(pause_ * kForgetting, kShortestPause);
    if (ratio > 1)
      simplify(std::min(ratio, 4.0), static_cast<double>(triangles));
    else if ((limited || smaller_ > 1) && ratio < kFull)
      refine(ratio);
    else if (plain_ && !limited && smaller_ == 1)
      plain_ = --until_try_ > 0 || ratio > kLeisure || !has_room_for_rest(seconds);
  }

  /// Whether to leave occlusion and multisampling out while something moves.
  bool plain() const { return plain_; }
  /// Of a preview.
  std::uint64_t max_triangles() const {
    return triangles_ < kUnlimited ? static_cast<std::uint64_t>(triangles_) : kAllTriangles;
  }
  /// Divisor of the picture's width and height while something moves. At rest: 1.
  int smaller() const { return smaller_; }

 private:
  static constexpr double kUnlimited = 1e12;
  static constexpr double kFirstInSoftware = 60'000;
  /// Before previews become smaller: in software, and at the very least.
  static constexpr double kFew = 40'000, kFewest = 2'000;
  static constexpr double kNothingDrawn = 1e-3;  ///< seconds: the picture was the one before
  /// Of the target: a preview takes so long, and one that takes between kFull and 1 is left as it
  /// is; less than kLeisure is time for occlusion.
  static constexpr double kAim = 0.9, kFull = 0.8, kLeisure = 0.6;
  static constexpr double kLargestStep = 1.5;  ///< single pictures are off
  /// Of the target: less is no reason for another size.
  static constexpr double kALittle = 1.25;
  /// Of the target, with the rest: more is too much, as a processor that is slower for a moment
  /// needs what is left.
  static constexpr double kMostWithRest = 0.75;
  static constexpr double kShortestPause = 30, kLongestPause = 1000, kForgetting = 0.95;
  static constexpr double kFading = 0.998;
  static constexpr int kSmallest = 4;

  void simplify(double ratio, double drawn) {
    const double triangles = std::min(triangles_, drawn);
    const bool a_little = ratio < kALittle || smaller_ == kSmallest;
    if (triangles <= few_ && !a_little)
      smaller_ = std::min(static_cast<int>(std::ceil(smaller_ * std::sqrt(ratio))), kSmallest);
    else
      triangles_ = std::max(triangles * kAim / ratio, a_little ? kFewest : few_);
  }

  /// What a picture with occlusion and multisampling takes beside the same one without.
  void learn_rest(double seconds) {
    if (last_plain_ == 0) return;
    rest_before_ = std::exchange(rest_, std::max(seconds - last_plain_, 0.0));
  }

  /// Of the last two times the quicker one counts, as a single one may have been slow for another
  /// reason; in the course of some hundred pictures both are forgotten, as it may take less by now.
  bool has_room_for_rest(double plain_seconds) {
    rest_ *= kFading;
    rest_before_ *= kFading;
    return plain_seconds + std::min(rest_, rest_before_) <= kMostWithRest * target_;
  }

  /// The rest may have taken long for once, or may take less soon: it is tried again. Each time
  /// that shows and may be a picture that takes too long, so it is tried less and less often.
  void leave_rest_out() {
    plain_ = true;
    until_try_ = pause_;
    pause_ = std::min(2 * pause_, kLongestPause);
  }

  void refine(double ratio) {
    const double larger = static_cast<double>(smaller_) / std::max(smaller_ - 1, 1);
    if (smaller_ > 1 && triangles_ >= few_ / 2) {
      if (ratio * larger * larger < kFull) --smaller_;
    } else {
      triangles_ *= std::min(kAim / ratio, kLargestStep);
    }
  }

  double target_;
  double pause_ = kShortestPause;      ///< plain pictures before the rest is tried, the next time
  double until_try_ = 0;               ///< the same, now
  double rest_ = 0, rest_before_ = 0;  ///< seconds that it took; see learn_rest()
  double last_plain_ = 0;  ///< seconds, of one with all detail; 0: none since the last stop
  double triangles_ = std::numeric_limits<double>::infinity();
  double few_ = kFew;  ///< before previews become smaller
  int smaller_ = 1;
  bool plain_ = false;
};

}  // namespace isobrick

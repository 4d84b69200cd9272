#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

namespace isobrick {

/// Keeps pictures fluent while something moves by asking for simpler ones: first
/// without occlusion and multisampling, then with cells up to four times as long, then
/// smaller, which is what helps where OpenGL is software, at last with cells still
/// longer. Where a device draws, with much longer cells before smaller: it gets other memory for
/// another size, which takes longer than a picture may. Not thread-safe.
class FramePacer {
 public:
  /// `target`: how long a picture may take while something moves, seconds.
  explicit FramePacer(double target = 1.0 / 20) : target_(target) {}

  /// For a store that has just been opened: 20 pictures a second in software, which begins with
  /// simple ones; as many as displays show where a device draws.
  static FramePacer for_device(bool software) {
    FramePacer pacer(software ? 1.0 / 20 : 1.0 / 80);
    if (!software) {
      pacer.first_coarser_ = kCoarsest;
      return pacer;
    }
    pacer.plain_ = true;
    pacer.until_try_ = kShortestPause;
    pacer.rest_ = pacer.rest_before_ = pacer.target_;  // a pixel takes long there
    pacer.coarser_ = kFirstInSoftware;
    return pacer;
  }

  /// A picture in full that took `seconds`, while nothing moved: the first one that
  /// moves is then fluent as well.
  void drawn_still(double seconds) {
    if (seconds < kNothingDrawn) return;
    const double ratio = seconds / target_;
    last_plain_ = 0;
    // While something changes there is more to do than to draw.
    plain_ = ratio > kLeisure;
    if (plain_) until_try_ = ratio > kMostWithRest ? pause_ : kShortestPause;
    coarser_ = std::clamp(kMargin * std::sqrt(ratio), 1.0, kCoarsest);
  }

  /// A picture that took `seconds` to draw as plain(), coarser() and smaller() say now.
  void drawn(double seconds) {
    const double ratio = seconds / target_;
    if (!plain_)
      learn_rest(seconds);
    else if (coarser_ == 1 && smaller_ == 1)
      last_plain_ = seconds;
    if (!plain_ && ratio > kMostWithRest) {
      leave_rest_out();
      return;
    }
    if (!plain_) pause_ = std::max(pause_ * kForgetting, kShortestPause);
    if (ratio > 1)
      simplify(std::min(ratio, 4.0));
    else if ((coarser_ > 1 || smaller_ > 1) && ratio < kLeisure)
      refine(ratio);
    else if (plain_ && coarser_ == 1 && smaller_ == 1)
      plain_ = --until_try_ > 0 || ratio > kLeisure || !has_room_for_rest(seconds);
  }

  /// Whether to leave occlusion and multisampling out while something moves.
  bool plain() const { return plain_; }
  /// Factor on the error in pixels while something moves. At rest: 1.
  double coarser() const { return coarser_; }
  /// Divisor of the picture's width and height while something moves. At rest: 1.
  int smaller() const { return smaller_; }

 private:
  static constexpr double kFirstCoarser = 4, kCoarsest = 32, kMargin = 1.25, kFirstInSoftware = 16;
  static constexpr double kNothingDrawn = 1e-3;  ///< seconds: the picture was the one before
  static constexpr double kLeisure = 0.6;        ///< of the target: less is time for more
  /// Of the target, with the rest: more is too much, as a processor that is slower for a moment
  /// needs what is left.
  static constexpr double kMostWithRest = 0.75;
  static constexpr double kShortestPause = 30, kLongestPause = 1000, kForgetting = 0.95;
  static constexpr double kFading = 0.998;
  static constexpr int kSmallest = 4;

  void simplify(double ratio) {
    if (coarser_ >= first_coarser_ && smaller_ < kSmallest) {
      smaller_ = std::min(static_cast<int>(std::ceil(smaller_ * std::sqrt(ratio))), kSmallest);
      return;
    }
    // Triangles, and so times, go with the inverse square of a cell's length: the root
    // of the ratio would do at once, but single pictures are off.
    const double most = smaller_ < kSmallest ? first_coarser_ : kCoarsest;
    coarser_ = std::min(coarser_ * (1 + 0.5 * (ratio - 1)), most);
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
    if (coarser_ > 1) {
      coarser_ = std::max(coarser_ * (0.7 + 0.5 * ratio), 1.0);
    } else {
      const double larger = static_cast<double>(smaller_) / (smaller_ - 1);
      if (ratio * larger * larger < kLeisure) --smaller_;
    }
  }

  double target_, coarser_ = 1;
  double pause_ = kShortestPause;      ///< plain pictures before the rest is tried, the next time
  double until_try_ = 0;               ///< the same, now
  double rest_ = 0, rest_before_ = 0;  ///< seconds that it took; see learn_rest()
  double last_plain_ = 0;  ///< seconds, of one with all detail; 0: none since the last stop
  double first_coarser_ = kFirstCoarser;  ///< before pictures become smaller
  int smaller_ = 1;
  bool plain_ = false;
};

}  // namespace isobrick

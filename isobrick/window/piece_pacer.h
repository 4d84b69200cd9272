#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

namespace isobrick {

/// How much of a picture can be drawn within a time, by what pieces have taken before; see
/// Renderer::end_piece(). Not thread-safe.
class PiecePacer {
 public:
  /// In software the first piece is a small one; a device is taken to be quick.
  explicit PiecePacer(bool software)
      : rate_(software ? kFirstRate : std::numeric_limits<double>::infinity()) {}

  /// Of the next piece, to take so long.
  std::uint64_t work(double seconds) const {
    const double most = rate_ * seconds;
    return most < kAll ? static_cast<std::uint64_t>(std::max(most, kLeast))
                       : std::numeric_limits<std::uint64_t>::max();
  }

  /// A piece took `seconds`. What was slow may be so again at once, what was quick is believed
  /// piece by piece.
  void drawn(std::uint64_t work, double seconds) {
    if (work == 0 || seconds <= 0) return;
    const double rate = static_cast<double>(work) / seconds;
    rate_ = std::min(rate, 2 * rate_);
  }

 private:
  static constexpr double kFirstRate = 1e6;  ///< a second
  /// Less takes no shorter, since each piece has a price of its own.
  static constexpr double kLeast = 5000;
  static constexpr double kAll = 1e18;

  double rate_;
};

}  // namespace isobrick

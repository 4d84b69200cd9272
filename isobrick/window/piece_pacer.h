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

  /// Of the next piece, to take so long. Of `left` no rest is left that would take a quarter of
  /// that.
  std::uint64_t work(double seconds, std::uint64_t left = kMost) const {
    const double most = std::max(rate_ * seconds, kLeast);
    if (static_cast<double>(left) <= (1 + kLeastPart) * most) return left;
    return most < kAll ? static_cast<std::uint64_t>(most) : kMost;
  }

  /// OpenGL was told within `seconds` to draw a piece, which goes on until one of the functions
  /// below. All that was told before the piece before must be drawn.
  void told(std::uint64_t work, double seconds) {
    before_ = last_;
    last_ = {work, seconds};
  }
  /// The piece before the last one is drawn, if there is one; it was waited for so long.
  void drawn_before_last(double waited) {
    learn({before_.work, before_.seconds + waited});
    before_ = {};
  }
  /// All is drawn; it was waited for so long.
  void drawn_all(double waited) {
    learn({before_.work + last_.work, before_.seconds + last_.seconds + waited});
    before_ = last_ = {};
  }

 private:
  static constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();

  struct Piece {
    std::uint64_t work = 0;
    double seconds = 0;
  };

  /// What was slow may be so again at once, what was quick is believed piece by piece.
  void learn(const Piece& drawn) {
    if (drawn.work == 0 || drawn.seconds <= 0) return;
    const double rate = static_cast<double>(drawn.work) / drawn.seconds;
    rate_ = std::min(rate, 2 * rate_);
  }

  static constexpr double kFirstRate = 1e6;  ///< a second
  /// Less takes no shorter, since each piece has a price of its own.
  static constexpr double kLeast = 5000;
  static constexpr double kAll = 1e18;
  static constexpr double kLeastPart = 0.25;

  double rate_;
  Piece before_, last_;  ///< that may not be drawn; no work: there is none
};

}  // namespace isobrick

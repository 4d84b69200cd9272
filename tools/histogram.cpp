#include "tools/histogram.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tools/value_range.h"

namespace isobrick::tools {
namespace {

/// Height of a column in eighths of a character.
int height_of(std::uint64_t count, std::uint64_t most, int rows) {
  if (count == 0) return 0;
  const double part = std::sqrt(static_cast<double>(count) / static_cast<double>(most));
  return std::max(1, static_cast<int>(std::lround(part * rows * 8)));
}

}  // namespace

std::string draw(const Histogram& h, int rows, ScalarType type) {
  if (h.counts.empty()) return "no finite sample\n";
  constexpr std::array<const char*, 9> blocks{" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  const std::uint64_t most = *std::max_element(h.counts.begin(), h.counts.end());
  std::string text;
  for (int row = rows - 1; row >= 0; --row) {
    text += "  ";
    for (const std::uint64_t count : h.counts)
      text += blocks[static_cast<std::size_t>(
          std::clamp(height_of(count, most, rows) - 8 * row, 0, 8))];
    text += '\n';
  }
  const std::string lo = sample_text(h.lo, type), hi = sample_text(h.hi, type);
  const std::size_t gap =
      h.counts.size() > lo.size() + hi.size() ? h.counts.size() - lo.size() - hi.size() : 1;
  return text + "  " + lo + std::string(gap, ' ') + hi + '\n';
}

}  // namespace isobrick::tools

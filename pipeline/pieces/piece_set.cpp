#include "pipeline/pieces/piece_set.h"

#include <algorithm>
#include <string>

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

/// "parts 2, 5 and 7", of those that `has` is false for.
std::string missing_text(const std::vector<bool>& has) {
  constexpr std::size_t shown = 8;
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < has.size(); ++i)
    if (!has[i]) missing.push_back(i + 1);
  std::string text = fmt::format("{}", missing.front());
  for (std::size_t i = 1; i < std::min(missing.size(), shown); ++i)
    text += fmt::format("{}{}", i + 1 == missing.size() ? " and " : ", ", missing[i]);
  if (missing.size() > shown) text += fmt::format(" and {} more", missing.size() - shown);
  return fmt::format("{} {}", missing.size() == 1 ? "part" : "parts", text);
}

}  // namespace

std::uint64_t PieceSet::memory() const {
  std::uint64_t sum = 0;
  for (const Piece& piece : pieces) sum += 2 * (piece.path.native().size() + sizeof(Piece));
  return sum;
}

PieceCollector::PieceCollector(std::span<const std::filesystem::path> paths) : paths_(paths) {
  if (paths.empty()) throw UsageError("there are no pieces to merge");
}

void PieceCollector::add(const PieceKey& key, const PieceEnd& end) {
  const std::filesystem::path& path = paths_[set_.pieces.size()];
  if (set_.pieces.empty()) first_ = key;
  std::string other = difference(first_.mesh, key.mesh);
  if (other.empty() && key.part.count != first_.part.count)
    other = fmt::format("number of parts ({} and {})", first_.part.count, key.part.count);
  if (!other.empty())
    throw UsageError(fmt::format("'{}' and '{}' are pieces of different meshes: they differ in {}",
                                 paths_.front().string(), path.string(), other));
  set_.pieces.push_back({path, key.part, key.tiles, end.bytes, end.content_crc32c});
  set_.vertices += end.vertices;
  set_.triangles += end.triangles;
  set_.bytes += end.bytes;
  set_.largest_tile = std::max(set_.largest_tile, end.largest_tile);
}

PieceSet PieceCollector::collected() && {
  std::sort(set_.pieces.begin(), set_.pieces.end(),
            [](const PieceSet::Piece& a, const PieceSet::Piece& b) {
              return a.part.number < b.part.number;
            });
  check_parts();
  return std::move(set_);
}

void PieceCollector::check_parts() const {
  const std::vector<PieceSet::Piece>& found = set_.pieces;
  std::vector<bool> has(first_.part.count);
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (i > 0 && found[i].part.number == found[i - 1].part.number)
      throw UsageError(fmt::format("'{}' and '{}' are both part {}: leave one of them out",
                                   found[i - 1].path.string(), found[i].path.string(),
                                   part_text(found[i].part)));
    has[found[i].part.number - 1] = true;
  }
  if (found.size() < has.size())
    throw UsageError(fmt::format("{} of {} {} missing", missing_text(has), has.size(),
                                 found.size() + 1 == has.size() ? "is" : "are"));
  for (std::size_t i = 1; i < found.size(); ++i)
    if (found[i].tiles.begin != found[i - 1].tiles.end)
      throw UsageError(fmt::format("'{}' does not go on where '{}' ends: make both again",
                                   found[i].path.string(), found[i - 1].path.string()));
}

}  // namespace isobrick

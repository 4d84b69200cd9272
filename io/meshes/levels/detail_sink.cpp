#include "io/meshes/levels/detail_sink.h"

#include <algorithm>
#include <utility>

#include "io/meshes/levels/level_maker.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

/// What the simplification takes beside the memory of its options, and what encoding takes in its
/// place: MeshFilterOptions::memory.
constexpr std::uint64_t kWorkBytes = 120 * kMiB;

}  // namespace

std::uint64_t level_memory(const LevelOptions& options) { return options.memory + kWorkBytes; }

std::uint64_t level_share(std::uint64_t budget) {
  // No more of a small budget, whatever it is: so a budget that is called enough is enough.
  return budget < 512 * kMiB ? 16 * kMiB : std::min(budget / 8, 1024 * kMiB);
}

DetailSink::DetailSink(std::unique_ptr<LevelWriter> writer, const LevelOptions& options)
    : writer_(std::move(writer)), options_(options) {}

DetailSink::~DetailSink() = default;

void DetailSink::begin(const MeshHeader& header) {
  maker_ = make_levels(*writer_, options_, kWorkBytes, header);
}

void DetailSink::write(const MeshChunk& chunk) { maker_->write(chunk); }
void DetailSink::finish() { maker_->finish(); }

std::uint64_t DetailSink::bytes() const {
  return (maker_ ? maker_->bytes() : 0) + writer_->bytes();
}

std::vector<WrittenLevel> DetailSink::levels() const {
  return maker_ ? maker_->levels() : std::vector<WrittenLevel>();
}

}  // namespace isobrick

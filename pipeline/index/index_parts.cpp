#include "pipeline/index/index_parts.h"

#include <sys/stat.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <span>
#include <string>

#include <fmt/format.h>

#include "bricks/stored_index.h"
#include "bricks/zarr/codec.h"
#include "core/morton.h"
#include "io/bytes/folder_walk.h"
#include "io/bytes/output_folder.h"
#include "pipeline/index/level_index.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Beside the store, also where it is named as "." or through a link.
fs::path root_of(const fs::path& store) {
  fs::path name = without_slash(store);
  if (name.filename() == "." || name.filename() == ".." || name.filename().empty())
    name = fs::canonical(name);
  return name.string() + ".index.parts";
}

/// `total` * `number` / `count`, which may be more than 64 bits on the way.
std::uint64_t share(std::uint64_t total, std::uint32_t number, std::uint32_t count) {
  return total / count * number + total % count * number / count;
}

/// What costs the same time: all bricks of a level as if they had all samples.
std::uint64_t weight(const LevelInfo& level) {
  return static_cast<std::uint64_t>(volume(level.lattice.brick));
}

std::uint64_t brick_count(const LevelInfo& level) {
  return static_cast<std::uint64_t>(volume(level.lattice.bricks()));
}

/// The first brick of a level whose work begins at `at` or later, of work that begins at `base`.
std::uint64_t first_brick(const LevelInfo& level, std::uint64_t base, std::uint64_t at) {
  if (at <= base) return 0;
  return std::min((at - base + weight(level) - 1) / weight(level), brick_count(level));
}

/// Of the bricks of a run that lie in layer `z`, boxes that hold them all: what there is of the
/// first row, whole rows, what there is of the last.
std::vector<Box3> boxes_of_layer(BrickRun run, Index z, Int3 grid) {
  const auto layer = static_cast<std::uint64_t>(grid.x * grid.y);
  const std::uint64_t base = static_cast<std::uint64_t>(z) * layer;
  const auto begin = static_cast<Index>(std::max(run.begin, base) - base);
  const auto end = static_cast<Index>(std::min(run.end, base + layer) - base);
  const Index y0 = begin / grid.x, x0 = begin % grid.x, y1 = end / grid.x, x1 = end % grid.x;
  if (y0 == y1) return {{{x0, y0, z}, {x1, y0 + 1, z + 1}}};
  std::vector<Box3> boxes;
  if (x0 > 0) boxes.push_back({{x0, y0, z}, {grid.x, y0 + 1, z + 1}});
  if (const Index first = x0 > 0 ? y0 + 1 : y0; first < y1)
    boxes.push_back({{0, first, z}, {grid.x, y1, z + 1}});
  if (x1 > 0) boxes.push_back({{0, y1, z}, {x1, y1 + 1, z + 1}});
  return boxes;
}

}  // namespace

IndexParts::IndexParts(const StoreReader& store, const IndexOptions& options, std::uint32_t count)
    : store_(store), count_(count), root_(root_of(store.storage()->local_path())) {
  const StoreInfo& info = store.info();
  IndexLayout layout = index_layout(store, 0, options);
  layout.ranges_crc32c = 0;  // which one part does not know of others
  const std::string key =
      fmt::format("1 {} {} {}", to_json(layout), info.additions, info.metadata_crc32c);
  key_ = crc32c(std::as_bytes(std::span(key)));
  folder_ = root_ / info.additions / layout.kind;
  if (options.leaf < kBlockEdge) {
    std::vector<std::uint64_t> before{0};  // cells
    for (int level = 0; level < static_cast<int>(info.levels.size()); ++level) {
      const IndexLayout of_level = index_layout(store, level, options);
      for_each_morton(of_level.chunks(), [&](Int3 c) {
        chunks_.push_back({level, c});
        const auto bricks = volume(of_level.bricks_of_chunk(c).extent());
        before.push_back(before.back() + static_cast<std::uint64_t>(bricks));
      });
    }
    // A chunk belongs to the part that its middle lies in.
    for (std::uint32_t number = 0; number <= count; ++number) {
      const std::uint64_t begin = share(2 * before.back(), number, count);
      std::size_t first = begins_.empty() ? 0 : begins_.back();
      while (first < chunks_.size() && before[first] + before[first + 1] < begin) ++first;
      begins_.push_back(number == count ? chunks_.size() : first);
    }
  } else {
    begins_.assign(std::size_t{count} + 1, 0);
  }
}

BrickRun IndexParts::bricks(int level, std::uint32_t number) const {
  const std::vector<LevelInfo>& levels = store_.info().levels;
  std::uint64_t base = 0, total = 0;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (i == static_cast<std::size_t>(level)) base = total;
    total += brick_count(levels[i]) * weight(levels[i]);
  }
  const LevelInfo& info = levels[static_cast<std::size_t>(level)];
  return {first_brick(info, base, share(total, number - 1, count_)),
          first_brick(info, base, share(total, number, count_))};
}

Box3 IndexParts::bounds(int level, BrickRun run) const {
  const Int3 grid = store_.info().levels[static_cast<std::size_t>(level)].lattice.bricks();
  const Int3 first = point_at(static_cast<Index>(run.begin), grid);
  const Int3 last = point_at(static_cast<Index>(run.end - 1), grid);
  Box3 box{first, last + Int3{1, 1, 1}};
  if (first.z != last.z) {
    box.lo.y = 0;
    box.hi.y = grid.y;
  }
  if (first.z != last.z || first.y != last.y) {
    box.lo.x = 0;
    box.hi.x = grid.x;
  }
  return box;
}

std::vector<Box3> IndexParts::boxes(int level, std::uint32_t number) const {
  std::vector<Box3> all;
  const BrickRun run = bricks(level, number);
  if (run.empty()) return all;
  const Int3 grid = store_.info().levels[static_cast<std::size_t>(level)].lattice.bricks();
  const Box3 bounds = this->bounds(level, run);
  for (Index z = bounds.lo.z; z < bounds.hi.z; ++z)
    for (const Box3& box : boxes_of_layer(run, z, grid)) all.push_back(box);
  return all;
}

std::vector<IndexParts::Chunk> IndexParts::chunks(std::uint32_t number) const {
  const auto at = [&](std::uint32_t part) {
    return chunks_.begin() + static_cast<std::ptrdiff_t>(begins_[part]);
  };
  return {at(number - 1), at(number)};
}

fs::path IndexParts::folder_of(std::uint32_t number) const {
  return folder_ / fmt::format("{}of{}", number, count_);
}

fs::path IndexParts::ranges_file(std::uint32_t number) const {
  return folder_of(number) / "ranges";
}

fs::path IndexParts::chunk_file(std::uint32_t number, const Chunk& chunk) const {
  return folder_of(number) / std::to_string(chunk.level) / index_chunk_name(chunk.chunk);
}

std::uint32_t IndexParts::add_files(int level, Box3 bricks, std::uint32_t crc) const {
  const LevelInfo& info = store_.info().levels[static_cast<std::size_t>(level)];
  const Int3 per_shard = ceil_div(info.shard, info.lattice.brick);
  const Box3 shards{floor_div(bricks.lo, per_shard), ceil_div(bricks.hi, per_shard)};
  const Int3 count = shards.extent();
  const fs::path folder = store_.storage()->local_path();
  // Bytes, seconds and nanoseconds; of a file that is not there -1.
  std::vector<std::array<std::int64_t, 3>> states(static_cast<std::size_t>(volume(count)));
  tbb::parallel_for(std::size_t{0}, states.size(), [&](std::size_t i) {
    const Int3 shard = shards.lo + point_at(static_cast<Index>(i), count);
    const fs::path file = folder / store_.key_of(level, shard * per_shard);
    struct stat status {};
    if (::stat(file.c_str(), &status) == 0)
      states[i] = {status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
    else
      states[i] = {-1, 0, 0};
  });
  return crc32c(std::as_bytes(std::span(states)), crc);
}

std::uint32_t IndexParts::ranges_state(std::uint32_t number) const {
  std::uint32_t crc = key_;
  for (int level = 0; level < static_cast<int>(store_.info().levels.size()); ++level)
    for (const Box3& box : boxes(level, number)) crc = add_files(level, box, crc);
  return crc;
}

IndexChunkName IndexParts::name_of(const Chunk& chunk) const {
  constexpr Index edge = IndexLayout::kBrick * IndexLayout::kChunk;
  const Lattice& lattice = store_.info().levels[static_cast<std::size_t>(chunk.level)].lattice;
  const Int3 lo = chunk.chunk * edge;
  const Box3 samples = intersect({lo, lo + Int3{edge + 1, edge + 1, edge + 1}}, lattice.box());
  const std::uint32_t level_key = crc32c(std::as_bytes(std::span(&chunk.level, 1)), key_);
  return {chunk.chunk, add_files(chunk.level, lattice.bricks_of(samples), level_key)};
}

bool IndexParts::has_rest() const {
  if (is_there(folder_)) return true;
  if (!is_there(root_)) return false;
  bool has_files = false;  // of others
  walk_folder(root_, [&](const fs::path&, fs::file_type type) {
    has_files = type != fs::file_type::directory;
    return !has_files;
  });
  return !has_files;
}

void IndexParts::remove() const {
  std::error_code none;
  if (!fs::is_directory(root_, none)) return;
  const OutputFolder root(root_);
  for (std::uint32_t number = 1; number <= count_; ++number)
    if (is_there(folder_of(number))) root.remove_folder(folder_of(number));
  // Those of others stay, and the folders that hold them.
  for (fs::path folder = folder_;; folder = folder.parent_path()) {
    fs::remove(folder, none);
    if (none || folder == root_) return;
  }
}

}  // namespace isobrick

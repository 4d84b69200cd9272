#include "pipeline/verify/verify_index.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <vector>

#include <isobrick/error.h>
#include "core/morton.h"
#include "pipeline/index/index_chunk_builder.h"
#include "pipeline/program_memory.h"
#include "pipeline/workers.h"
#include "stream/index_search.h"

namespace isobrick::inline v0 {
namespace {

/// For making the parts anew: more is no faster.
constexpr std::uint64_t kEnough = 512 * kMiB;

/// The bytes that a part must have; null: it must be absent. Not `known`: neither can be checked.
struct ExpectedPart {
  const std::vector<std::byte>* bytes = nullptr;
  bool known = true;
};

class IndexCheck {
 public:
  IndexCheck(const StoreReader& store, int level, IndexKind kind,
             const std::function<void(const std::string&)>& damage)
      : level_(level),
        kind_(kind),
        damage_(damage),
        index_(store, level, std::string(name_of(kind))) {}

  const IndexLayout& layout() const { return index_.layout(); }
  std::uint64_t bytes_read() const { return bytes_read_; }

  /// Compares a chunk with what `builder` makes of the same cells.
  void run(Int3 c, const IndexChunkBuilder& builder);

 private:
  std::string name_of_part(Box3 bricks, std::size_t part) const;
  std::optional<std::string> wrong(const IndexChunk& chunk, Box3 bricks, std::size_t part,
                                   const ExpectedPart& expected) const;
  void check_parts(const IndexChunk& chunk, Int3 c, const IndexChunkBuilder& builder);

  int level_;
  IndexKind kind_;
  const std::function<void(const std::string&)>& damage_;
  StoredIndex index_;
  std::uint64_t bytes_read_ = 0;
};

Int3 brick_of(Box3 bricks, std::size_t part) {
  return bricks.lo + point_at(static_cast<Index>(part) - 1, bricks.extent());
}

std::string IndexCheck::name_of_part(Box3 bricks, std::size_t part) const {
  if (part == IndexLayout::kDirectory)
    return fmt::format("level {}, {} index, directory", level_, name_of(kind_));
  return index_brick_name(level_, kind_, brick_of(bricks, part));
}

/// What is wrong with a part, if anything.
std::optional<std::string> IndexCheck::wrong(const IndexChunk& chunk, Box3 bricks, std::size_t part,
                                             const ExpectedPart& expected) const {
  std::vector<std::byte> bytes;
  try {
    if (!chunk.read(part, bytes)) {
      if (!expected.bytes) return std::nullopt;
      return fmt::format("'{}' has no such part", chunk.name());
    }
  } catch (const DamageError& e) {
    return e.what();
  }
  if (expected.known && !expected.bytes)
    return chunk.where(part) + ": is there, but its cells have one value";
  const Int3 grid = part == IndexLayout::kDirectory
                        ? bricks.extent()
                        : layout().leaves_of_brick(brick_of(bricks, part));
  try {
    open_index_part(bytes, kind_, layout().type, grid);
  } catch (const DamageError& e) {
    return chunk.where(part) + ": " + e.what();
  }
  if (expected.known && bytes != *expected.bytes)
    return chunk.where(part) + ": is not what the store's ranges and samples make";
  return std::nullopt;
}

/// Each part that must be there, then those that must not be.
void IndexCheck::check_parts(const IndexChunk& chunk, Int3 c, const IndexChunkBuilder& builder) {
  const Box3 bricks = layout().bricks_of_chunk(c);
  std::vector<bool> seen(layout().parts_of_chunk(c));
  const auto check = [&](std::size_t part, const ExpectedPart& expected) {
    seen[part] = true;
    if (const auto what = wrong(chunk, bricks, part, expected))
      damage_(name_of_part(bricks, part) + ": " + *what);
  };
  bool known = true;
  try {
    builder.build(
        c, [](std::vector<std::byte> part) { return part; },
        [&](std::size_t part, const std::vector<std::byte>& bytes) { check(part, {&bytes}); });
  } catch (const DamageError&) {
    known = false;  // ranges or bricks are damaged, which others report
  }
  for (std::size_t part = 0; part < seen.size(); ++part)
    if (!seen[part]) check(part, {nullptr, known});
}

void IndexCheck::run(Int3 c, const IndexChunkBuilder& builder) {
  try {
    const IndexChunk chunk = index_.open(c);
    check_parts(chunk, c, builder);
    bytes_read_ += chunk.bytes_read();
  } catch (const Error& e) {
    damage_(fmt::format("level {}, {} index, chunk ({}, {}, {}): {}", level_, name_of(kind_), c.x,
                        c.y, c.z, e.what()));
  }
}

}  // namespace

std::uint64_t verify_index(const StoreReader& store, int level, const std::string& kind,
                           int threads, std::uint64_t memory,
                           const std::function<void(const std::string&)>& damage,
                           Progress& progress) {
  const auto known = parse_index_kind(kind);
  if (!known || *known == IndexKind::linear) {
    damage(
        fmt::format("level {}: '{}' is no kind of index that this program knows", level,
                    store.storage()->name_of(index_folder(store.info().additions, level, kind))));
    return 0;
  }
  try {
    IndexCheck check(store, level, *known, damage);
    const IndexLayout& layout = check.layout();
    const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
    const auto least = [&] { return IndexChunkBuilder::min_memory(lattice, layout.leaf, threads); };
    while (threads > 1 && least() > memory) --threads;
    if (least() > memory)
      throw UsageError(
          fmt::format("the memory budget is too small: the {} index of level {} needs {} MiB more",
                      kind, level, (least() - memory) / kMiB + 1));
    const IndexChunkBuilder builder(store, level, layout, *known, std::min(memory, kEnough),
                                    threads);
    Workers workers(threads);
    progress.begin(fmt::format("verify {} index", kind),
                   static_cast<std::uint64_t>(volume(layout.bricks())));
    for_each_morton(layout.chunks(), [&](Int3 c) {
      workers.execute([&] { check.run(c, builder); });
      progress.advance(static_cast<std::uint64_t>(volume(layout.bricks_of_chunk(c).extent())));
    });
    progress.end();
    return check.bytes_read();
  } catch (const UsageError&) {
    throw;
  } catch (const Cancelled&) {
    throw;
  } catch (const Error& e) {
    damage(fmt::format("level {}: {}", level, e.what()));
    return 0;
  }
}

}  // namespace isobrick

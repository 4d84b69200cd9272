#include "pipeline/verify/verify_index.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "core/morton.h"
#include "index/label_lists.h"
#include "pipeline/index/index_chunk_builder.h"
#include "pipeline/index/label_chunk_builder.h"
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

/// Throws DamageError for the bytes of a part that are not sound; `grid` is that of its items.
using OpenPart =
    std::function<void(std::span<const std::byte> bytes, const IndexLayout& layout, Int3 grid)>;

class IndexCheck {
 public:
  IndexCheck(const StoreReader& store, int level, std::string kind, OpenPart open,
             const std::function<void(const std::string&)>& damage)
      : level_(level),
        kind_(std::move(kind)),
        open_(std::move(open)),
        damage_(damage),
        index_(store, level, kind_) {}

  const IndexLayout& layout() const { return index_.layout(); }
  std::uint64_t bytes_read() const { return bytes_read_; }

  /// Compares a chunk with what `make` makes of the same cells.
  void run(Int3 c, const MakeIndexParts& make);

 private:
  std::string name_of_part(Box3 bricks, std::size_t part) const;
  std::optional<std::string> wrong(const IndexChunk& chunk, Box3 bricks, std::size_t part,
                                   const ExpectedPart& expected) const;
  void check_parts(const IndexChunk& chunk, Int3 c, const MakeIndexParts& make);

  int level_;
  std::string kind_;
  OpenPart open_;
  const std::function<void(const std::string&)>& damage_;
  StoredIndex index_;
  std::uint64_t bytes_read_ = 0;
};

Int3 brick_of(Box3 bricks, std::size_t part) {
  return bricks.lo + point_at(static_cast<Index>(part) - 1, bricks.extent());
}

std::string IndexCheck::name_of_part(Box3 bricks, std::size_t part) const {
  if (part == IndexLayout::kDirectory)
    return fmt::format("level {}, {} index, directory", level_, kind_);
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
    open_(bytes, layout(), grid);
  } catch (const DamageError& e) {
    return chunk.where(part) + ": " + e.what();
  }
  if (expected.known && bytes != *expected.bytes)
    return chunk.where(part) + ": is not what the store's ranges and samples make";
  return std::nullopt;
}

/// Each part that must be there, then those that must not be.
void IndexCheck::check_parts(const IndexChunk& chunk, Int3 c, const MakeIndexParts& make) {
  const Box3 bricks = layout().bricks_of_chunk(c);
  std::vector<bool> seen(layout().parts_of_chunk(c));
  const auto check = [&](std::size_t part, const ExpectedPart& expected) {
    seen[part] = true;
    if (const auto what = wrong(chunk, bricks, part, expected))
      damage_(name_of_part(bricks, part) + ": " + *what);
  };
  bool known = true;
  try {
    make(
        c, [](std::vector<std::byte> part) { return part; },
        [&](std::size_t part, const std::vector<std::byte>& bytes) { check(part, {&bytes}); });
  } catch (const DamageError&) {
    known = false;  // ranges or bricks are damaged, which others report
  }
  for (std::size_t part = 0; part < seen.size(); ++part)
    if (!seen[part]) check(part, {nullptr, known});
}

void IndexCheck::run(Int3 c, const MakeIndexParts& make) {
  try {
    const IndexChunk chunk = index_.open(c);
    check_parts(chunk, c, make);
    bytes_read_ += chunk.bytes_read();
  } catch (const Error& e) {
    damage_(fmt::format("level {}, {} index, chunk ({}, {}, {}): {}", level_, kind_, c.x, c.y, c.z,
                        e.what()));
  }
}

/// How an index of a kind is checked.
struct CheckedKind {
  OpenPart open;
  /// Least memory on so many threads.
  std::function<std::uint64_t(const Lattice& lattice, const IndexLayout& layout, int threads)>
      least;
  std::function<MakeIndexParts(const StoreReader& store, int level, const IndexLayout& layout,
                               std::uint64_t memory, int threads)>
      builder;
};

CheckedKind checked_labels() {
  return {
      .open = [](std::span<const std::byte> bytes, const IndexLayout&,
                 Int3 grid) { unpack_label_lists(bytes, static_cast<std::size_t>(volume(grid))); },
      .least = [](const Lattice& lattice, const IndexLayout&,
                  int threads) { return LabelChunkBuilder::min_memory(lattice, threads); },
      .builder = label_index_parts};
}

CheckedKind checked_ranges(IndexKind kind) {
  return {.open = [kind](std::span<const std::byte> bytes, const IndexLayout& layout,
                         Int3 grid) { open_index_part(bytes, kind, layout.type, grid); },
          .least =
              [](const Lattice& lattice, const IndexLayout& layout, int threads) {
                return IndexChunkBuilder::min_memory(lattice, layout.leaf, threads);
              },
          .builder =
              [kind](const StoreReader& store, int level, const IndexLayout& layout,
                     std::uint64_t memory, int threads) {
                return span_index_parts(store, level, layout, kind, memory, threads);
              }};
}

std::optional<CheckedKind> checked_kind(const std::string& name) {
  if (name == kLabelIndex) return checked_labels();
  const auto kind = parse_index_kind(name);
  if (!kind || *kind == IndexKind::linear) return std::nullopt;
  return checked_ranges(*kind);
}

}  // namespace

std::uint64_t verify_index(const StoreReader& store, int level, const std::string& kind,
                           int threads, std::uint64_t memory,
                           const std::function<void(const std::string&)>& damage,
                           Progress& progress) {
  const std::optional<CheckedKind> known = checked_kind(kind);
  if (!known) {
    damage(
        fmt::format("level {}: '{}' is no kind of index that this program knows", level,
                    store.storage()->name_of(index_folder(store.info().additions, level, kind))));
    return 0;
  }
  try {
    IndexCheck check(store, level, kind, known->open, damage);
    const IndexLayout& layout = check.layout();
    const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
    const auto least = [&] { return known->least(lattice, layout, threads); };
    while (threads > 1 && least() > memory) --threads;
    if (least() > memory)
      throw UsageError(
          fmt::format("the memory budget is too small: the {} index of level {} needs {} MiB more",
                      kind, level, (least() - memory) / kMiB + 1));
    const MakeIndexParts make =
        known->builder(store, level, layout, std::min(memory, kEnough), threads);
    Workers workers(threads);
    progress.begin(fmt::format("verify {} index", kind),
                   static_cast<std::uint64_t>(volume(layout.bricks())));
    for_each_morton(layout.chunks(), [&](Int3 c) {
      workers.execute([&] { check.run(c, make); });
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

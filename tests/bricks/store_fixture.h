#pragma once

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/store_reader.h>
#include "bricks/store_writer.h"
#include "bricks/zarr/codec.h"
#include "tests/temporary_folder.h"

namespace isobrick::test {

inline std::string read_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void write_file(const std::filesystem::path& path, const std::string& content) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << content;
}

/// One level in memory: C order [z, y, x], and how it is cut.
struct Level {
  Lattice lattice;
  Int3 shard;
  Transform transform;
  std::vector<std::byte> samples;

  LevelInfo info() const { return {lattice, shard, transform}; }
};

/// Noise, with a region of fill value where `with_absent` is set.
inline Level make_level(ScalarType type, Int3 extent, Index brick, Index shard, double fill,
                        bool with_absent, unsigned seed = 1) {
  Level level{{extent, {brick, brick, brick}, type}, {shard, shard, shard}, {}, {}};
  level.samples.resize(static_cast<std::size_t>(volume(extent)) * size_of(type));
  std::mt19937 random(seed);
  const std::uint64_t bits = fill_bits(type, fill);
  visit_sample(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    std::byte* to = level.samples.data();
    for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
      T value = static_cast<T>(static_cast<std::int32_t>(random()));
      if constexpr (std::numeric_limits<T>::has_infinity) {
        const auto special = random() % 50;
        if (special == 0)
          value = std::numeric_limits<T>::quiet_NaN();
        else if (special == 1)
          value = -std::numeric_limits<T>::infinity();
        else
          value /= T{1024};
      }
      const bool absent = with_absent && (p.x / brick + p.y / brick + p.z / brick) % 2 == 1;
      if (absent)
        std::memcpy(to, &bits, sizeof value);
      else
        std::memcpy(to, &value, sizeof value);
      to += sizeof value;
    });
  });
  return level;
}

/// The samples of brick `b`, padded as bricks are.
inline std::vector<std::byte> cut_brick(const Level& level, Int3 b, double fill) {
  const Lattice& l = level.lattice;
  std::vector<std::byte> brick(l.brick_bytes());
  const Box3 box = l.brick_box(b);
  const std::size_t size = l.sample_bytes();
  for_each_point(box, [&](Int3 p) {
    const auto to = static_cast<std::size_t>(linear_index(p - box.lo, l.brick)) * size;
    const auto from = static_cast<std::size_t>(linear_index(p, l.extent)) * size;
    std::memcpy(brick.data() + to, level.samples.data() + from, size);
  });
  pad_brick(l, b, fill, brick.data());
  return brick;
}

/// How the bricks of a store are compressed: by a level of zstd, not at all, or by another codec.
struct Compression {
  BrickCodec codec = BrickCodec::none;
  int zstd_level = 3;

  Compression(std::nullopt_t) {}
  Compression(BrickCodec of) : codec(of) {}
  Compression(int level) : codec(BrickCodec::zstd), zstd_level(level) {}
  Compression(std::optional<int> level) {
    if (level) *this = *level;
  }
  CodecChain chain() const { return CodecChain::of(codec, zstd_level, false); }
};

inline StoreLayout make_layout(const std::vector<Level>& levels, Compression compression,
                               double fill) {
  StoreLayout layout;
  for (const Level& level : levels) layout.levels.push_back(level.info());
  layout.codec = compression.codec;
  layout.zstd_level = compression.zstd_level;
  layout.fill_value = fill;
  layout.name = "test";
  return layout;
}

/// Ranges of items of `edge` cells (samples), as pairs of the level's type.
inline std::vector<std::byte> make_ranges(const Level& level, Int3 edge) {
  const Lattice& l = level.lattice;
  const Int3 items = ceil_div(l.extent, edge);
  std::vector<std::byte> pairs(static_cast<std::size_t>(volume(items)) * 2 * l.sample_bytes());
  visit_sample(l.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    std::byte* to = pairs.data();
    for_each_point({{0, 0, 0}, items}, [&](Int3 i) {
      ValueRange<T> range;
      const Box3 touched =
          intersect({i * edge, (i + Int3{1, 1, 1}) * edge + Int3{1, 1, 1}}, l.box());
      for_each_point(touched, [&](Int3 p) {
        T value;
        std::memcpy(
            &value,
            level.samples.data() + static_cast<std::size_t>(linear_index(p, l.extent)) * sizeof(T),
            sizeof value);
        range.include(value);
      });
      std::memcpy(to, &range.lo, sizeof(T));
      std::memcpy(to + sizeof(T), &range.hi, sizeof(T));
      to += 2 * sizeof(T);
    });
  });
  return pairs;
}

inline Int3 shards_of(const Level& level) { return ceil_div(level.lattice.extent, level.shard); }

/// Puts the bricks of one shard and finishes it.
inline void write_shard(StoreWriter& writer, const std::vector<Level>& levels, int number, Int3 s,
                        Compression compression, double fill) {
  const Level& level = levels[static_cast<std::size_t>(number)];
  const Int3 n = ceil_div(level.shard, level.lattice.brick);
  for_each_point(intersect({s * n, (s + Int3{1, 1, 1}) * n}, {{0, 0, 0}, level.lattice.bricks()}),
                 [&](Int3 b) {
                   const auto encoded = encode_brick(level.lattice, cut_brick(level, b, fill), fill,
                                                     compression.chain());
                   writer.put(number, b, encoded ? *encoded : std::vector<std::byte>());
                 });
  writer.finish_shard(number, s);
}

inline void write_ranges(StoreWriter& writer, const std::vector<Level>& levels) {
  for (int i = 0; i < static_cast<int>(levels.size()); ++i) {
    const Level& level = levels[static_cast<std::size_t>(i)];
    const Lattice& l = level.lattice;
    writer.put_brick_ranges(i, {{0, 0, 0}, l.bricks()}, make_ranges(level, l.brick));
    writer.put_block_ranges(i, {{0, 0, 0}, l.blocks()},
                            make_ranges(level, {kBlockEdge, kBlockEdge, kBlockEdge}));
  }
}

inline void write_store(const std::filesystem::path& path, const std::vector<Level>& levels,
                        Compression compression, double fill) {
  StoreWriter writer(path, make_layout(levels, compression, fill), false);
  for (int i = 0; i < static_cast<int>(levels.size()); ++i)
    for_each_point({{0, 0, 0}, shards_of(levels[static_cast<std::size_t>(i)])},
                   [&](Int3 s) { write_shard(writer, levels, i, s, compression, fill); });
  write_ranges(writer, levels);
  writer.finish(is_floating(levels[0].lattice.type));
}

/// All samples of a level as the reader gives them.
inline std::vector<std::byte> read_level(const StoreReader& store, int number) {
  const Lattice& l = store.info().levels[static_cast<std::size_t>(number)].lattice;
  const std::size_t size = l.sample_bytes();
  const std::uint64_t bits = fill_bits(l.type, store.info().fill_value);
  std::vector<std::byte> samples(static_cast<std::size_t>(volume(l.extent)) * size);
  std::vector<std::byte> brick(l.brick_bytes());
  for_each_point({{0, 0, 0}, l.bricks()}, [&](Int3 b) {
    const bool present = store.read_brick(number, b, brick.data());
    const Box3 box = l.brick_box(b);
    for_each_point(box, [&](Int3 p) {
      const auto from = static_cast<std::size_t>(linear_index(p - box.lo, l.brick)) * size;
      const auto to = static_cast<std::size_t>(linear_index(p, l.extent)) * size;
      if (present)
        std::memcpy(samples.data() + to, brick.data() + from, size);
      else
        std::memcpy(samples.data() + to, &bits, size);
    });
  });
  return samples;
}

}  // namespace isobrick::test

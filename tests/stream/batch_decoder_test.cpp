#include "stream/batch_decoder.h"

#include <gtest/gtest.h>

#include <deque>
#include <fstream>

#include <isobrick/error.h>
#include "packed/packed_brick.h"
#include "tests/stream/heap_memory.h"
#include "tests/stream/stored_volume.h"

namespace isobrick::test {
namespace {

/// As a device has it: a thread decodes a brick to a buffer of its own, which is then sent.
class ElsewhereMemory final : public HeapMemory {
 public:
  ElsewhereMemory(std::size_t brick, int threads)
      : buffers_(static_cast<std::size_t>(threads), std::vector<std::byte>(brick)) {}
  std::byte* begin(int thread, std::byte*) override { return buffer(thread).data(); }
  void end(int thread, std::byte* place) override {
    std::copy(buffer(thread).begin(), buffer(thread).end(), place);
  }

 private:
  std::vector<std::byte>& buffer(int thread) {
    return buffers_.at(static_cast<std::size_t>(thread));
  }
  std::vector<std::vector<std::byte>> buffers_;
};

/// As a device that decodes packed bricks has it: each is decoded in its place after a while.
class DecodingMemory final : public HeapMemory {
 public:
  DecodingMemory(const Lattice& lattice, int threads)
      : lattice_(lattice),
        buffers_(static_cast<std::size_t>(threads),
                 std::vector<std::byte>(2 * lattice.brick_bytes())) {}
  bool takes_packed() const override { return true; }
  std::span<std::byte> begin_packed(int thread) override { return buffer(thread); }
  void end_packed(int thread, std::byte* place, const PackedLoad& load) override {
    EXPECT_LE(load.range.lo, load.range.hi);
    unpack_brick(lattice_.type, lattice_.brick, std::span(buffer(thread)).first(load.bytes),
                 {place, lattice_.brick_bytes()});
  }
  std::optional<Int3> find_damaged(bool all) override { return all ? at_the_end : meanwhile; }

  std::optional<Int3> meanwhile, at_the_end;

 private:
  std::vector<std::byte>& buffer(int thread) {
    return buffers_.at(static_cast<std::size_t>(thread));
  }
  Lattice lattice_;
  std::vector<std::vector<std::byte>> buffers_;
};

class NoMemory final : public BrickMemory {
  std::shared_ptr<std::byte> room(std::size_t) override { throw Error("no memory"); }
};

class Decoder : public StoredVolume {
 protected:
  struct Way {
    Index reach = 0;
    std::size_t tiles = 4, capacity = 1000;
    int threads = 3;
    std::size_t held = 1;    ///< batches that are in use at a time
    bool elsewhere = false;  ///< bricks are decoded elsewhere than where they lie
    bool packed = false;     ///< where they lie they are decoded
  };
  struct Seen {
    std::vector<Int3> tiles;
    std::uint64_t reads = 0, bricks_read = 0;
    std::size_t bytes = 0;
  };

  /// Decodes the whole volume and compares all bricks that tiles need.
  Seen decode(const Way& way) const {
    const StoreReader store(path_);
    const Lattice& lattice = store.info().levels[0].lattice;
    TileStream stream(store, 0, 20000, lattice.box());
    BatchPlanner planner(stream, lattice, way.reach, false, way.tiles, way.capacity / way.held);
    Seen seen;
    std::unique_ptr<HeapMemory> memory = std::make_unique<HeapMemory>();
    if (way.elsewhere)
      memory = std::make_unique<ElsewhereMemory>(lattice.brick_bytes(), way.threads);
    if (way.packed) memory = std::make_unique<DecodingMemory>(lattice, way.threads);
    BatchDecoder decoder(store, 0, planner, way.reach, way.capacity, way.threads, *memory);
    std::deque<std::shared_ptr<const DecodedBatch>> held;
    while (auto batch = decoder.next()) {
      held.push_back(std::move(batch));
      for (const TileWork& work : held.back()->tiles()) {
        seen.tiles.push_back(work.tile);
        for_each_needed_box(lattice, work, way.reach, [&](Box3 box) {
          const Int3 last = box.hi - Int3{1, 1, 1};
          const Box3 bricks{{box.lo.x / 32, box.lo.y / 32, box.lo.z / 32},
                            {last.x / 32 + 1, last.y / 32 + 1, last.z / 32 + 1}};
          // What is held longest would be what is overwritten first.
          for_each_point(bricks, [&](Int3 b) { expect_samples(*held.back(), b); });
        });
      }
      for_each_needed_box(lattice, held.front()->tiles().front(), way.reach, [&](Box3 box) {
        expect_samples(*held.front(), {box.lo.x / 32, box.lo.y / 32, box.lo.z / 32});
      });
      if (held.size() == way.held) held.pop_front();
    }
    seen.reads = decoder.reads();
    seen.bricks_read = decoder.bricks_read();
    seen.bytes = memory->bytes;
    return seen;
  }
};

TEST_F(Decoder, EveryTileComesOnceWithItsBricksHoweverShortRoomIs) {
  const StoreReader store(path_);
  const Lattice& lattice = store.info().levels[0].lattice;
  const std::vector<Int3> expected = active_tiles(store, 20000);
  ASSERT_GT(expected.size(), 20u);
  for (const Index reach : {0, 1}) {
    const std::size_t least = max_bricks_of_tile(lattice, reach);
    for (const Way& way : {Way{reach}, Way{reach, 1, least, 1}, Way{reach, 7, least + 3, 4},
                           Way{reach, 3, 3 * least, 2, 3}, Way{reach, 1000, 1000, 5},
                           Way{reach, 3, 3 * least, 2, 3, true}}) {
      const Seen seen = decode(way);
      EXPECT_EQ(seen.tiles, expected);
      EXPECT_LE(seen.bytes, way.capacity * lattice.brick_bytes());
      EXPECT_GE(seen.reads, seen.bricks_read);
      if (way.capacity == 1000) {
        EXPECT_EQ(seen.reads, seen.bricks_read);
      }
    }
  }
}

TEST_F(Decoder, PackedBricksMayBeDecodedWhereTheyLie) {
  make_store(BrickCodec::packed);
  const std::vector<Int3> expected = active_tiles(StoreReader(path_), 20000);
  EXPECT_EQ(decode({.reach = 1}).tiles, expected);  // on the processor
  EXPECT_EQ(decode({.reach = 1, .packed = true}).tiles, expected);
}

// The processor looks at the brick that a device finds wrong, and says what is wrong with it.
TEST_F(Decoder, WhatADeviceFindsWrongEndsIt) {
  make_store(BrickCodec::packed);
  const StoreReader store(path_);
  const Lattice& lattice = store.info().levels[0].lattice;
  const auto fails = [&](std::optional<Int3> meanwhile, std::optional<Int3> at_the_end) {
    TileStream stream(store, 0, 20000, lattice.box());
    BatchPlanner planner(stream, lattice, 0, false, 2, 50);
    DecodingMemory memory(lattice, 2);
    memory.meanwhile = meanwhile;
    memory.at_the_end = at_the_end;
    BatchDecoder decoder(store, 0, planner, 0, 50, 2, memory);
    std::size_t batches = 0;
    try {
      while (decoder.next()) ++batches;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find("brick (2, 1, 0)"), std::string::npos) << e.what();
      return batches;
    }
    ADD_FAILURE() << "goes on";
    return batches;
  };
  EXPECT_EQ(fails(Int3{2, 1, 0}, {}), 0u);
  EXPECT_GT(fails({}, Int3{2, 1, 0}), 1u);
}

TEST_F(Decoder, WhoeverTakesBatchesMayStopEarly) {
  const StoreReader store(path_);
  const Lattice& lattice = store.info().levels[0].lattice;
  TileStream stream(store, 0, 20000, lattice.box());
  BatchPlanner planner(stream, lattice, 0, false, 2, 50);
  HeapMemory memory;
  BatchDecoder decoder(store, 0, planner, 0, 50, 2, memory);
  EXPECT_NE(decoder.next(), nullptr);
  EXPECT_NE(decoder.next(), nullptr);
}

TEST_F(Decoder, DamageAndWantOfMemoryReachWhoeverTakesBatches) {
  const auto decode_all = [&](BrickMemory&& memory) {
    const StoreReader store(path_);
    TileStream stream(store, 0, 20000, store.info().levels[0].lattice.box());
    BatchPlanner planner(stream, store.info().levels[0].lattice, 0, false, 2, 50);
    BatchDecoder decoder(store, 0, planner, 0, 50, 2, memory);
    while (decoder.next()) {
    }
  };
  EXPECT_THROW(decode_all(NoMemory()), Error);
  for (const auto& file : std::filesystem::recursive_directory_iterator(path_ / "0"))
    if (file.is_regular_file() && file.file_size() > 4096) {
      std::fstream damaged(file.path(), std::ios::in | std::ios::out | std::ios::binary);
      damaged.seekp(1000);
      damaged.write("damaged", 7);
    }
  EXPECT_THROW(decode_all(HeapMemory()), DamageError);
}

}  // namespace
}  // namespace isobrick::test

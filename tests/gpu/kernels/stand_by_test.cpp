#include <gtest/gtest.h>

#include <atomic>
#include <bit>
#include <limits>
#include <thread>

#include "isobrick/core/threshold.h"
#include "tests/gpu/kernels/kernel_volume.h"

// A launch that stays for further isovalues makes what launches of their own would, and leaves when
// it should. The host's side is StandingLaunch's, word by word.

namespace isobrick::testing {
namespace {

using gpu::LaunchReport, gpu::LaunchRequest, gpu::LaunchWord;

constexpr std::uint64_t kForever = std::numeric_limits<std::uint64_t>::max();

/// A launch on a thread of its own, and the host that asks it.
template <class T>
class Standing {
 public:
  Standing(Field<T> field, SurfaceOptions options)
      : field_(std::move(field)),
        lattice_{field_.extent, {64, 64, 64}, scalar_type_of<T>},
        bricks_(lattice_, field_.samples.data()),
        volume_(field_, bricks_, lattice_, options),
        state_(volume_.tiles() * gpu::kSlabsOfTile),
        room_(120'000, 240'000) {}
  ~Standing() {
    if (kernel_.joinable()) write_leave(state_.launches + 1);
  }

  /// Launches for an isovalue. The launch waits for the next for `patience`, and asks for no
  /// further one when it has stayed for `most`, of the kernels' time.
  void launch(double isovalue, std::uint64_t patience, std::uint64_t most, unsigned seed) {
    if (kernel_.joinable()) kernel_.join();
    write_leave(state_.launches + 1);  // what was asked of the one before is not meant for this one
    gpu::TileParams p = volume_.params(isovalue);
    const gpu::FoundTiles found = volume_.find(isovalue);
    p.found = found.count;
    std::ranges::copy(found.tiles, p.found_tiles);
    state_.give(p, true);
    room_.give(p);
    const unsigned blocks = volume_.tiles() * gpu::kSlabsOfTile;
    p.stand_by = {&request_, &passed_on_, &ended_, ended_before_, patience, most};
    ended_before_ += blocks;
    asked_ = false;
    const emulated::TileRun run{.type = lattice_.type,
                                .normals = volume_.options.normals,
                                .threads = gpu::kSlabTeam,
                                .blocks = blocks,
                                .seed = seed};
    kernel_ = std::jthread([=, this] { emulated::run_tiles(run, p, volume_.cases()); });
  }

  /// Asks the launch that stands by.
  void ask(double isovalue) {
    asked_ = true;
    ++state_.epoch;
    const std::uint32_t launch = ++state_.launches;
    ended_before_ += volume_.tiles() * gpu::kSlabsOfTile;
    std::uint32_t threshold = 0;
    const auto value = Threshold<T>(isovalue).value;
    std::memcpy(&threshold, &value, sizeof value);
    const gpu::FoundTiles found = volume_.find(isovalue);
    write(LaunchRequest::kThreshold, threshold, launch);
    write(LaunchRequest::kCrossing, std::bit_cast<std::uint32_t>(static_cast<float>(isovalue)),
          launch);
    for (int i = 0; i < LaunchRequest::kLeave - LaunchRequest::kTiles; ++i)
      write(LaunchRequest::kTiles + i, found.words[i], launch);
    write(LaunchRequest::kLeave, 0, launch);
  }

  /// Waits until what was asked for last is told. False where the launch has left without it.
  bool has_told() {
    const std::uint64_t left = LaunchWord::of(state_.launches - 1, state_.launches - 1);
    for (;;) {
      if (asked_ && state_.word(LaunchReport::kLeft) == left) break;
      int told = 0;
      for (int i = 0; i < LaunchReport::kWords; ++i)
        told += LaunchWord::is_about(state_.word(i), state_.launches);
      if (told == LaunchReport::kWords) return true;
      std::this_thread::yield();
    }
    --state_.launches;
    ended_before_ -= volume_.tiles() * gpu::kSlabsOfTile;
    return false;
  }
  void expect_told(double isovalue) {
    ASSERT_TRUE(has_told());
    state_.expect_told(volume_.mesh(isovalue), volume_.find(isovalue).count);
  }

  void dismiss() { write_leave(state_.launches + 1); }
  /// The host may look at the mesh when the launch is over.
  void expect_mesh(double isovalue) {
    kernel_.join();
    room_.expect_begins_with(volume_.mesh(isovalue));
    state_.expect_zeroed();
  }
  void expect_left() {
    kernel_.join();
    EXPECT_EQ(state_.word(LaunchReport::kLeft), LaunchWord::of(state_.launches, state_.launches));
  }

 private:
  void write(int word, std::uint32_t value, std::uint32_t launch) {
    std::atomic_ref(request_.words[word])
        .store(LaunchWord::of(value, launch), std::memory_order_relaxed);
  }
  void write_leave(std::uint32_t launch) {
    for (int i = 0; i < LaunchRequest::kWords; ++i)
      write(i, i == LaunchRequest::kLeave ? 1 : 0, launch);
  }

  Field<T> field_;
  Lattice lattice_;
  DenseBricks bricks_;
  KernelVolume<T> volume_;
  KernelState state_;
  MeshRoom room_;
  LaunchRequest request_{}, passed_on_{};
  std::uint32_t ended_ = 0, ended_before_ = 0;
  bool asked_ = false;  ///< the launch that stands by, not begun anew
  std::jthread kernel_;
};

template <class T>
class StandBy : public ::testing::Test {
 protected:
  static constexpr double kMid = TestFields<T>::lowest() + 100;
  /// Two tiles, whose blocks all fit at a time.
  static Field<T> waves() { return TestFields<T>::waves({32, 30, 50}); }
};

TYPED_TEST_SUITE(StandBy, DeviceTypes);

TYPED_TEST(StandBy, MakesOneMeshAfterTheOther) {
  const double mid = TestFixture::kMid;
  const auto field = TestFixture::waves();
  for (const bool normals : {false, true}) {
    SurfaceOptions options;
    options.normals = normals;
    Standing<TypeParam> standing(field, options);
    unsigned seed = 1;
    for (const double last : {mid + 20.5, mid - 15}) {
      standing.launch(mid, kForever, kForever, seed++);
      standing.expect_told(mid);
      for (const double isovalue : {mid - 20, mid + 45, mid + 3, last}) {
        standing.ask(isovalue);
        standing.expect_told(isovalue);
      }
      standing.dismiss();
      standing.expect_mesh(last);
    }
  }
}

TYPED_TEST(StandBy, LeavesWhenNothingComes) {
  Standing<TypeParam> standing(TestFixture::waves(), {});
  standing.launch(TestFixture::kMid, 100'000, kForever, 1);
  standing.expect_told(TestFixture::kMid);
  standing.expect_left();
  standing.ask(TestFixture::kMid + 1);
  EXPECT_FALSE(standing.has_told());
  standing.launch(TestFixture::kMid + 1, 100'000, kForever, 2);
  standing.expect_told(TestFixture::kMid + 1);
  standing.expect_mesh(TestFixture::kMid + 1);
}

/// When the threads of a warp look at the clock, time may be up for some of them only.
TYPED_TEST(StandBy, LeavesAsOne) {
  Standing<TypeParam> standing(TestFixture::waves(), {});
  unsigned seed = 1;
  for (std::uint64_t most = 100; most < 3000; most += 300) {
    const double isovalue = TestFixture::kMid + seed;  // not the mesh that is there
    standing.launch(isovalue, kForever, most, seed++);
    standing.expect_told(isovalue);
    standing.dismiss();
    standing.expect_mesh(isovalue);
  }
}

/// However soon the next one comes.
TYPED_TEST(StandBy, LeavesWhenItHasStayedForLong) {
  const double mid = TestFixture::kMid;
  Standing<TypeParam> standing(TestFixture::waves(), {});
  int launches = 1, isovalues = 0;
  standing.launch(mid, kForever, 20'000, 1);
  for (; isovalues < 12; ++isovalues) {
    ASSERT_TRUE(standing.has_told());
    standing.ask(mid + isovalues);
    if (standing.has_told()) continue;
    standing.launch(mid + isovalues, kForever, 20'000, static_cast<unsigned>(++launches));
  }
  EXPECT_GT(launches, 1);
  standing.dismiss();
  standing.expect_mesh(mid + isovalues - 1);
}

}  // namespace
}  // namespace isobrick::testing

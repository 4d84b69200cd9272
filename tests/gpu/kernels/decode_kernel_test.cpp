#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include <isobrick/error.h>
#include "packed/packed_brick.h"
#include "packed/packed_layout.h"
#include "tests/gpu/kernels/decode_runner.h"
#include "tests/packed/fields.h"

// The kernel that decodes packed bricks, beside the CPU's decoder.

namespace isobrick::testing {
namespace {

/// Bricks as a device has them, and what the kernel makes of them.
class Decoded {
 public:
  Decoded(ScalarType type, Int3 extent)
      : type_(type), extent_(extent), params_(gpu::decode_params(extent)) {}

  void add(std::span<const std::byte> packed) {
    const packed::BrickLayout layout(type_, extent_, packed);
    // As many bytes as may be read, so that a sanitizer sees what lies beyond.
    auto& words = packed_.emplace_back((packed.size() + 8 + 3) / 4);
    std::memcpy(words.data(), packed.data(), packed.size());
    auto& samples = samples_.emplace_back(static_cast<std::size_t>(volume(extent_)));
    params_.bricks[params_.count] = {reinterpret_cast<const std::uint8_t*>(words.data()),
                                     samples.data(), static_cast<std::uint32_t>(layout.entries()),
                                     layout.is_plain(), 100 + params_.count};
    ++params_.count;
  }
  void run(unsigned seed) {
    params_.failed = &failed_;
    emulated::run_decode(type_, params_, seed);
  }
  /// The number of the first damaged brick.
  unsigned long long failed() const { return failed_; }
  std::vector<std::byte> samples(std::size_t i) const {
    std::vector<std::byte> bytes(static_cast<std::size_t>(volume(extent_)) * size_of(type_));
    std::memcpy(bytes.data(), samples_[i].data(), bytes.size());
    return bytes;
  }

 private:
  ScalarType type_;
  Int3 extent_;
  gpu::DecodeParams params_;
  std::vector<std::vector<std::uint32_t>> packed_;
  std::vector<std::vector<std::uint64_t>> samples_;
  unsigned long long failed_ = ~0ull;
};

class DecodeKernel : public ::testing::TestWithParam<ScalarType> {};

TEST_P(DecodeKernel, FindsTheSamplesThatWerePacked) {
  const ScalarType type = GetParam();
  unsigned seed = 0;
  for (const Int3 extent : {Int3{64, 32, 16}, Int3{32, 48, 20}, Int3{19, 16, 17}, Int3{1, 1, 1}}) {
    Decoded decoded(type, extent);
    std::vector<std::vector<std::byte>> bricks;
    for (const std::string& field : test::kFields) {
      bricks.push_back(test::make_brick(type, extent, field));
      decoded.add(pack_brick(type, extent, bricks.back()));
    }
    decoded.run(++seed);
    EXPECT_EQ(decoded.failed(), ~0ull);
    for (std::size_t i = 0; i < bricks.size(); ++i)
      EXPECT_EQ(decoded.samples(i), bricks[i]) << test::kFields[i] << ' ' << extent.x;
  }
}

// What the CPU refuses the kernel names, and what the CPU takes for other samples it does as well.
TEST_P(DecodeKernel, RefusesWhatTheCpuRefuses) {
  const ScalarType type = GetParam();
  const Int3 extent{32, 16, 16};
  std::mt19937 random(5);
  for (const char* field : {"smooth", "noisy", "sparse", "labels"}) {
    const auto whole = pack_brick(type, extent, test::make_brick(type, extent, field));
    for (int round = 0; round < 40; ++round) {
      std::vector<std::byte> bytes = whole;
      // Half of the changes where heads and masks lie.
      const std::size_t place =
          random() % (round % 2 == 0 ? std::min<std::size_t>(bytes.size(), 120) : bytes.size());
      bytes[place] ^= static_cast<std::byte>(1 << random() % 8);
      std::vector<std::byte> expected(static_cast<std::size_t>(volume(extent)) * size_of(type));
      bool good = true;
      try {
        unpack_brick(type, extent, bytes, expected);
      } catch (const DamageError&) {
        good = false;
      }
      Decoded decoded(type, extent);
      try {
        decoded.add(bytes);
      } catch (const DamageError&) {
        EXPECT_FALSE(good);
        continue;
      }
      decoded.run(static_cast<unsigned>(round));
      EXPECT_EQ(decoded.failed(), good ? ~0ull : 100u) << field << place;
      if (!good) continue;
      EXPECT_EQ(decoded.samples(0), expected) << field << place;
    }
  }
}

// Samples outside of the range are noticed, but not those of the padding, nor NaN.
TEST_P(DecodeKernel, ComparesWithRanges) {
  const ScalarType type = GetParam();
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    const Int3 extent{40, 20, 17};
    std::vector<T> samples(static_cast<std::size_t>(volume(extent)), T{50});
    if (is_floating(type)) samples[3] = std::numeric_limits<T>::quiet_NaN();
    unsigned long long failed = ~0ull;
    gpu::RangeCheckParams p{};
    p.count = 1;
    p.failed = &failed;
    for (int axis = 0; axis < 3; ++axis) p.extent[axis] = static_cast<std::int32_t>(extent[axis]);
    p.bricks[0] = {samples.data(), 7, 40, 60, {35, 20, 16}};
    const auto at = [&](Int3 place) -> T& {
      return samples[static_cast<std::size_t>(linear_index(place, extent))];
    };
    at({35, 3, 3}) = T{99};
    at({3, 3, 16}) = T{99};
    emulated::run_range_check(type, p, 1);
    EXPECT_EQ(failed, ~0ull);
    for (const T value : {T{39}, T{61}}) {
      failed = ~0ull;
      at({34, 19, 15}) = value;
      emulated::run_range_check(type, p, 2);
      EXPECT_EQ(failed, 7u);
    }
  });
}

INSTANTIATE_TEST_SUITE_P(Types, DecodeKernel, ::testing::ValuesIn(kSurfaceTypes),
                         [](const auto& test) { return std::string(zarr_name(test.param)); });

}  // namespace
}  // namespace isobrick::testing

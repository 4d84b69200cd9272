#include <isobrick/synth_source.h>

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "io/volumes/synth/synth_math.h"
#include "test_samples.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

constexpr SynthKind kKinds[] = {SynthKind::sphere, SynthKind::gyroid, SynthKind::marschner_lobb,
                                SynthKind::mixing, SynthKind::cells};

std::uint64_t fnv(const std::string& bytes) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return hash;
}

SynthOptions options(SynthKind kind, ScalarType type, Int3 extent = {41, 37, 43}) {
  SynthOptions o;
  o.kind = kind;
  o.type = type;
  o.extent = extent;
  return o;
}

std::string whole(const SynthOptions& o) { return read_box(*make_synth(o), {{0, 0, 0}, o.extent}); }

/// Parts of the active cells and of the samples that are inside.
struct Shares {
  double active, inside;
};

template <class T = std::uint8_t>
Shares shares(const SynthOptions& o) {
  const std::string bytes = whole(o);
  const double iso = default_isovalue(o.type);
  const auto inside = [&](Int3 p) {
    T v;
    std::memcpy(&v, bytes.data() + static_cast<std::size_t>(linear_index(p, o.extent)) * sizeof(T),
                sizeof(T));
    return static_cast<double>(v) >= iso;
  };
  Index active = 0, in = 0;
  for_each_point({{0, 0, 0}, o.extent - Int3{1, 1, 1}}, [&](Int3 p) {
    int corners = 0;
    for_each_point({p, p + Int3{2, 2, 2}}, [&](Int3 q) { corners += inside(q); });
    active += corners != 0 && corners != 8;
    in += inside(p);
  });
  const auto cells = static_cast<double>(volume(o.extent - Int3{1, 1, 1}));
  return {static_cast<double>(active) / cells, static_cast<double>(in) / cells};
}

TEST(SynthSource, GoldenBytes) {
  // Samples must never change: stores and figures made from them are compared.
  const std::map<SynthKind, std::array<std::uint64_t, 8>> golden = {
      {SynthKind::sphere,
       {0x99ec815bf67fde4c, 0x57fd53208d4ed0cc, 0x02c6fc4a0393ed53, 0xecff93ce2c993fd3,
        0x9688ac59e8ec868d, 0x1b2f09affea34d0d, 0xe770200c51725404, 0xa4b00bd1812f7ae8}},
      {SynthKind::gyroid,
       {0x132f5302b497aec0, 0x294f06760b82fa40, 0xbdd621e2868b964d, 0xfa302d00192ebacd,
        0xb61541c4624fbfd0, 0x296ecf9170df8850, 0x39abbed5236b96ad, 0xe1c326f9b109da65}},
      {SynthKind::marschner_lobb,
       {0xf26055f024ffdff0, 0xc272239e802f5570, 0x97f0e961f00f0725, 0x86697c5bff8463a5,
        0xdf9e337a231154a0, 0xd0958a58471cd120, 0x31ae42f8aa040fb3, 0xffc41ddedb01ad27}},
      {SynthKind::mixing,
       {0x168edf2592e60d92, 0x26ebab26279e0012, 0xeee6fa2aa8769db4, 0x06956a9993c54e34,
        0x62bb0c3d13dce6e0, 0xa746e84567565960, 0xe5a645e930269832, 0x338d00ba346a9536}},
      {SynthKind::cells,
       {0x14e2acdb5a225aa0, 0x14e2acdb5a225aa0, 0xe7b2a7d5fbc1da54, 0xe7b2a7d5fbc1da54,
        0xe5d2c2f743ef3394, 0xe5d2c2f743ef3394, 0x8fa62e75c162a617, 0x757dbccb19b798ed}},
  };
  for (const SynthKind kind : kKinds)
    for (const ScalarType type : kSurfaceTypes)
      EXPECT_EQ(fnv(whole(options(kind, type))), golden.at(kind)[static_cast<std::size_t>(type)])
          << name_of(kind) << " " << short_name(type) << std::hex << " 0x"
          << fnv(whole(options(kind, type)));
}

TEST(SynthSource, BoxesAgreeWithTheWhole) {
  const Int3 extent{41, 37, 43};
  for (const SynthKind kind : kKinds)
    for (const ScalarType type : {ScalarType::u8, ScalarType::i32, ScalarType::f32}) {
      const auto source = make_synth(options(kind, type));
      const std::string all = read_box(*source, {{0, 0, 0}, extent});
      const std::size_t size = size_of(type);
      for (const Box3 box : {Box3{{0, 0, 0}, {1, 1, 1}}, Box3{{7, 3, 5}, {30, 4, 43}},
                             Box3{{40, 36, 42}, extent}, Box3{{16, 16, 16}, {32, 32, 32}}}) {
        const std::string part = read_box(*source, box);
        std::size_t at = 0;
        for_each_point(box, [&](Int3 p) {
          const auto i = static_cast<std::size_t>(linear_index(p, extent)) * size;
          EXPECT_EQ(part.substr(at, size), all.substr(i, size));
          at += size;
        });
      }
    }
}

TEST(SynthSource, CellsAreNumbered) {
  SynthOptions o = options(SynthKind::cells, ScalarType::u16, {64, 64, 64});
  o.frequency = 4;
  const std::string bytes = whole(o);
  std::map<std::uint16_t, int> samples;
  for (std::size_t i = 0; i < bytes.size(); i += 2) {
    std::uint16_t label;
    std::memcpy(&label, bytes.data() + i, 2);
    ++samples[label];
  }
  EXPECT_EQ(samples.size(), 65u);
  EXPECT_EQ(samples.rbegin()->first, 64);
  EXPECT_GT(samples[0], 64 * 64 * 64 / 20);
  EXPECT_LT(samples[0], 64 * 64 * 64 / 2);
  o.type = ScalarType::u8;
  o.frequency = 8;
  EXPECT_THROW(make_synth(o), UsageError);
}

TEST(SynthSource, IsovaluesLieBetweenSamples) {
  EXPECT_EQ(default_isovalue(ScalarType::u8), 127.5);
  EXPECT_EQ(default_isovalue(ScalarType::i8), -0.5);
  EXPECT_EQ(default_isovalue(ScalarType::u16), 32767.5);
  EXPECT_EQ(default_isovalue(ScalarType::i16), -0.5);
  EXPECT_EQ(default_isovalue(ScalarType::u32), 2147483647.5);
  EXPECT_EQ(default_isovalue(ScalarType::i32), -0.5);
  EXPECT_EQ(default_isovalue(ScalarType::f32), 0);
  EXPECT_EQ(default_isovalue(ScalarType::f64), 0);
}

TEST(SynthSource, TheSphereIsABall) {
  const auto o = options(SynthKind::sphere, ScalarType::u16, {64, 64, 64});
  const double radius = 0.4 * 64, ball = 4.0 / 3 * 3.14159265 * radius * radius * radius;
  EXPECT_NEAR(shares<std::uint16_t>(o).inside, ball / (63.0 * 63 * 63), 0.002);
  // Every type has the same surface, but for rounding.
  EXPECT_NEAR(shares<double>(options(SynthKind::sphere, ScalarType::f64, {64, 64, 64})).inside,
              shares<std::int8_t>(options(SynthKind::sphere, ScalarType::i8, {64, 64, 64})).inside,
              0.002);
}

TEST(SynthSource, FrequencySetsTheGyroidsActiveCells) {
  auto o = options(SynthKind::gyroid, ScalarType::u8, {128, 128, 128});
  for (const double frequency : {0.5, 1.0, 2.0, 4.0}) {
    o.frequency = frequency;
    EXPECT_NEAR(shares(o).active, 4.6 * frequency / 128, 0.25 * 4.6 * frequency / 128);
  }
  EXPECT_NEAR(shares(o).inside, 0.5, 0.02);
}

TEST(SynthSource, EveryKindHasASurface) {
  for (const SynthKind kind : kKinds) {
    if (kind == SynthKind::cells) continue;  // is no field
    const Shares s = shares(options(kind, ScalarType::u8, {64, 64, 64}));
    EXPECT_GT(s.active, 0.01) << name_of(kind);
    EXPECT_GT(s.inside, 0.1) << name_of(kind);
    EXPECT_LT(s.inside, 0.9) << name_of(kind);
  }
}

TEST(SynthSource, TheFluidsAreUnmixedAtTopAndBottom) {
  const auto source = make_synth(options(SynthKind::mixing, ScalarType::u8, {32, 32, 64}));
  EXPECT_EQ(read_box(*source, {{0, 0, 0}, {32, 32, 12}}), std::string(32 * 32 * 12, '\0'));
  EXPECT_EQ(read_box(*source, {{0, 0, 52}, {32, 32, 64}}), std::string(32 * 32 * 12, '\xff'));
}

TEST(SynthSource, SeedsAndNoiseMatter) {
  auto o = options(SynthKind::mixing, ScalarType::u8);
  const auto one = whole(o);
  o.seed = 2;
  EXPECT_NE(whole(o), one);
  o = options(SynthKind::gyroid, ScalarType::u8);
  const auto noisy = whole(o);
  o.noise = 0;
  EXPECT_NE(whole(o), noisy);
}

TEST(SynthSource, ThinVolumes) {
  for (const SynthKind kind : kKinds)
    for (const Int3 extent : {Int3{1, 1, 1}, Int3{1, 9, 1}, Int3{2, 1, 300}})
      EXPECT_NO_THROW(whole(options(kind, ScalarType::f32, extent)));
}

TEST(SynthSource, RefusesWhatMakesNoSense) {
  auto o = options(SynthKind::gyroid, ScalarType::u8);
  for (const Int3 extent : {Int3{0, 1, 1}, Int3{1, 1, -1}, Int3{1 << 30, 1 << 30, 1 << 30}}) {
    o.extent = extent;
    message_of([&] { make_synth(o); });
  }
  o = options(SynthKind::mixing, ScalarType::u8);
  for (const double frequency : {0.0, -1.0, 1e300, std::nan("")}) {
    o.frequency = frequency;
    message_of([&] { make_synth(o); });
  }
  o.frequency = 4;
  o.noise = -1;
  message_of([&] { make_synth(o); });
}

TEST(SynthSource, Names) {
  for (const SynthKind kind : kKinds) EXPECT_EQ(parse_synth_kind(name_of(kind)), kind);
  EXPECT_FALSE(parse_synth_kind("cube"));
  EXPECT_EQ(make_synth({})->info().name, "gyroid");
}

TEST(SynthMath, Sine) {
  for (int i = -4000; i <= 4000; ++i) {
    const double turns = i / 777.0;
    EXPECT_NEAR(sin_turns(turns), std::sin(2 * 3.14159265358979323846 * turns), 1e-10);
  }
}

}  // namespace
}  // namespace isobrick

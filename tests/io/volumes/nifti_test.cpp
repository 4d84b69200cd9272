#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include <isobrick/open_source.h>
#include "damaged_files.h"
#include "io/bytes/byte_order.h"
#include "test_samples.h"
#include "tests/io/bytes/packed.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

constexpr Int3 kExtent{7, 5, 4};
constexpr Box3 kWhole{{0, 0, 0}, kExtent};

/// A NIfTI-1 or NIfTI-2 header, its fields set one by one.
class Header {
 public:
  explicit Header(int version, bool swap = false)
      : version_(version), swap_(swap), bytes_(version == 1 ? 352 : 544, '\0') {
    if (version == 1)
      put<std::int32_t>(0, 348).text(344, {"n+1\0", 4}).dims({3, 7, 5, 4}).put<float>(108, 352);
    else
      put<std::int32_t>(0, 540)
          .text(4, {"n+2\0\r\n\032\n", 8})
          .dims({3, 7, 5, 4})
          .put<std::int64_t>(168, 544);
    type(4);
  }

  template <class T>
  Header& put(std::size_t at, T value) {
    std::byte raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    if (swap_) swap_byte_order(raw, 1, sizeof(T));
    std::memcpy(bytes_.data() + at, raw, sizeof(T));
    return *this;
  }
  Header& real(std::size_t at1, std::size_t at2, std::initializer_list<double> values) {
    std::size_t i = 0;
    for (const double v : values) {
      if (version_ == 1)
        put<float>(at1 + 4 * i++, static_cast<float>(v));
      else
        put<double>(at2 + 8 * i++, v);
    }
    return *this;
  }
  Header& dims(std::initializer_list<std::int64_t> values) {
    std::size_t i = 0;
    for (const std::int64_t v : values) {
      if (version_ == 1)
        put<std::int16_t>(40 + 2 * i++, static_cast<std::int16_t>(v));
      else
        put<std::int64_t>(16 + 8 * i++, v);
    }
    return *this;
  }
  Header& code(std::size_t at1, std::size_t at2, int value) {
    return version_ == 1 ? put<std::int16_t>(at1, static_cast<std::int16_t>(value))
                         : put<std::int32_t>(at2, value);
  }
  Header& type(int code) {
    return put<std::int16_t>(version_ == 1 ? 70 : 12, static_cast<std::int16_t>(code));
  }
  Header& qform(int code_of) { return code(252, 344, code_of); }
  Header& sform(int code_of) { return code(254, 348, code_of); }
  Header& scale(double slope, double intercept) { return real(112, 176, {slope, intercept}); }
  Header& text(std::size_t at, std::string_view word) {
    bytes_.replace(at, word.size(), word);
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  int version_;
  bool swap_;
  std::string bytes_;
};

class Nifti : public ::testing::Test {
 protected:
  std::unique_ptr<VolumeSource> open(const std::string& bytes, const VolumeRequest& request = {}) {
    return open_source(dir.write("v.nii", bytes), request);
  }
  std::string refuse(const Header& header, const VolumeRequest& request = {}) {
    const auto message =
        message_of([&] { open(header.bytes() + std::string(560, '\0'), request); });
    EXPECT_TRUE(contains(message, "v.nii")) << message;
    return message;
  }
  static std::string samples(bool swap = false) {
    return sample_bytes(ScalarType::i16, kWhole, kExtent, swap);
  }

  TempDir dir;
};

TEST_F(Nifti, BothVersionsAndByteOrdersPlainAndPacked) {
  for (const int version : {1, 2})
    for (const bool swap : {false, true}) {
      const std::string bytes = Header(version, swap).bytes() + samples(swap);
      const auto plain = open(bytes);
      EXPECT_TRUE(plain->random_access());
      EXPECT_EQ(plain->info().extent, kExtent);
      EXPECT_EQ(plain->info().type, ScalarType::i16);
      EXPECT_EQ(read_box(*plain, kWhole), samples());
      EXPECT_EQ(read_box(*open(gzip(bytes)), kWhole), samples());
      EXPECT_EQ(read_box(*open(gzip(bytes + "padding")), kWhole), samples());
    }
}

TEST_F(Nifti, BytesAfterTheSamplesAreIgnoredWithANote) {
  const std::string bytes = Header(1).bytes() + samples();
  const std::pair<std::string, const char*> cases[] = {
      {bytes + "padding", ": 7 bytes after the samples are ignored"},
      {gzip(bytes + "padding"), ": 7 bytes after the samples are ignored"},
      {gzip(bytes) + std::string(512, '\0'), ": 512 bytes after the compressed data are ignored"}};
  for (const auto& [file, part] : cases) {
    const auto source = open(file);
    EXPECT_EQ(read_box(*source, kWhole), samples());
    ASSERT_EQ(source->notes().size(), 1u) << part;
    EXPECT_TRUE(contains(source->notes()[0], part)) << source->notes()[0];
  }
  EXPECT_TRUE(open(bytes)->notes().empty());
  // Of a volume with a scale, too.
  EXPECT_EQ(open(Header(1).scale(2, 0).bytes() + samples() + "!")->notes().size(), 1u);
}

TEST_F(Nifti, HeaderAndImageApart) {
  std::string header = Header(1).text(344, {"ni1\0", 4}).put<float>(108, 0).bytes();
  header.resize(348);
  dir.write("v.hdr", header);
  const auto refused_of = [&](const char* name) {
    return message_of<Error>([&] { open_source(dir / name, {}); });
  };
  const std::string missing = refused_of("v.hdr");
  EXPECT_TRUE(contains(missing, "v.img': No such file")) << missing;
  EXPECT_TRUE(contains(missing, "the header '" + (dir / "v.hdr") + "' needs it")) << missing;
  dir.write("v.img", samples().substr(1));
  for (const char* half : {"v.hdr", "v.img"})
    EXPECT_TRUE(contains(refused_of(half), "its header '" + (dir / "v.hdr") + "' promises"));
  std::filesystem::remove(dir / "v.img");
  dir.write("v.img", samples());
  EXPECT_EQ(read_box(*open_source(dir / "v.hdr", {}), kWhole), samples());
  dir.write("w.hdr.gz", gzip(header));
  dir.write("w.img.gz", gzip(samples()));
  EXPECT_EQ(read_box(*open_source(dir / "w.hdr.gz", {}), kWhole), samples());
  for (const char* image : {"v.img", "w.img.gz"}) {
    const auto source = open_source(dir / image, {});
    EXPECT_EQ(source->info().type, ScalarType::i16);
    EXPECT_EQ(read_box(*source, kWhole), samples());
  }
}

TEST_F(Nifti, ImagesOfNoPairAreRaw) {
  VolumeRequest raw;
  raw.extent = kExtent;
  raw.type = ScalarType::i16;
  dir.write("alone.img", samples());
  EXPECT_EQ(read_box(*open_source(dir / "alone.img", raw), kWhole), samples());
  dir.write("other.img", samples());
  dir.write("other.hdr", "ENVI\n");
  EXPECT_EQ(read_box(*open_source(dir / "other.img", raw), kWhole), samples());
  const auto message_for = [&](const char* name) {
    return message_of<UsageError>([&] { open_source(dir / name, {}); });
  };
  EXPECT_TRUE(contains(message_for("alone.img"), "needs its header '" + (dir / "alone.hdr")));
  EXPECT_TRUE(
      contains(message_for("other.img"), "other.hdr' beside it is not the header of a NIfTI"));
  dir.write("old.img", samples());
  dir.write("old.hdr", Header(1).text(344, {"\0\0\0\0", 4}).bytes());
  const std::string analyze = message_for("old.img");
  EXPECT_TRUE(contains(analyze, "old.img' has the header '" + (dir / "old.hdr"))) << analyze;
  EXPECT_TRUE(contains(analyze, "ANALYZE")) << analyze;
  EXPECT_EQ(read_box(*open_source(dir / "old.img", raw), kWhole), samples());
}

TEST_F(Nifti, ScaledValuesAreF32) {
  const Header header = Header(1).scale(0.5, -3);
  const auto source = open(header.bytes() + samples());
  ASSERT_EQ(source->info().type, ScalarType::f32);
  const Box3 box{{1, 2, 1}, {6, 4, 3}};
  const std::string bytes = read_box(*source, box);
  std::size_t i = 0;
  for_each_point(box, [&](Int3 p) {
    float got;
    std::memcpy(&got, bytes.data() + 4 * i++, 4);
    EXPECT_EQ(got, 0.5f * static_cast<float>(sample_at<std::int16_t>(p, kExtent)) - 3);
  });
  // A slope that changes nothing, or is no slope, keeps what is stored.
  for (const double slope : {1.0, 0.0, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_EQ(open(Header(1).scale(slope, 0).bytes() + samples())->info().type, ScalarType::i16);
  EXPECT_EQ(
      open(Header(2).type(64).scale(2, 0).bytes() + sample_bytes(ScalarType::f64, kWhole, kExtent))
          ->info()
          .type,
      ScalarType::f64);
}

TEST_F(Nifti, TimesAndChannels) {
  std::string all;
  for (int i = 0; i < 2 * 2 * 2 * 3 * 2; ++i) all += static_cast<char>(i);
  const std::string bytes = Header(1).type(2).dims({5, 2, 2, 2, 3, 2}).bytes() + all;
  for (const bool packed : {false, true})
    for (Index t = 0; t < 3; ++t)
      for (Index c = 0; c < 2; ++c) {
        VolumeRequest request;
        request.selection = {c, t};
        const auto source = open(packed ? gzip(bytes) : bytes, request);
        EXPECT_EQ(read_box(*source, {{0, 0, 0}, {2, 2, 2}}),
                  all.substr(static_cast<std::size_t>(8 * (t + 3 * c)), 8));
      }
  EXPECT_TRUE(contains(message_of([&] { open(bytes); }), "--channel 0 … 1"));
}

TEST_F(Nifti, WorldSpace) {
  const auto transform = [&](const Header& header) {
    return open(header.bytes() + samples())->info().transform;
  };
  for (const int version : {1, 2}) {
    Header header(version);
    header.real(76, 104, {-1, 2, 3, 0.5}).put<std::uint8_t>(version == 1 ? 123 : 500, 2);
    EXPECT_EQ(transform(header).spacing, (Vec3d{2, 3, 0.5}));
    EXPECT_EQ(transform(header).unit, "millimeter");
    // A quarter turn about z; the negative qfac turns z round.
    header.qform(1).real(256, 352, {0, 0, std::sqrt(0.5)}).real(268, 376, {10, 20, -30});
    const Vec3d q = transform(header).apply({1, 1, 2});
    EXPECT_NEAR(q.x, 7, 1e-5);
    EXPECT_NEAR(q.y, 22, 1e-5);
    EXPECT_NEAR(q.z, -31, 1e-5);
    header.sform(2).real(280, 400, {0, -4, 0, 1, 5, 0, 0, 2, 0, 0, 6, 3});
    EXPECT_EQ(transform(header).apply({1, 1, 1}), (Vec3d{-3, 7, 9}));
    // Sheared: qform holds; without one it is refused.
    header.real(280, 400, {1, 1, 0, 1, 0, 5, 0, 2, 0, 0, 6, 3});
    EXPECT_NEAR(transform(header).apply({1, 1, 2}).y, 22, 1e-5);
    EXPECT_TRUE(contains(refuse(header.qform(0)), "right angles"));
  }
}

TEST_F(Nifti, TheIntentOfLabels) {
  for (const int version : {1, 2})
    for (const bool swap : {false, true}) {
      const std::string content = samples(swap);
      const auto labels = [&](int intent) {
        const Header header = Header(version, swap).code(68, 504, intent);
        return open(header.bytes() + content)->info().labels;
      };
      EXPECT_EQ(labels(1002), LabelTable{}) << version << swap;
      EXPECT_FALSE(labels(0));
      EXPECT_FALSE(labels(1001));
    }
}

TEST_F(Nifti, RefusesWhatIsNotSupportedByName) {
  EXPECT_TRUE(contains(refuse(Header(1).type(128)), "RGB"));
  EXPECT_TRUE(contains(refuse(Header(1).type(1792)), "complex"));
  EXPECT_TRUE(contains(refuse(Header(1).type(77)), "unknown datatype 77"));
  EXPECT_TRUE(contains(refuse(Header(1).text(344, {"\0\0\0\0", 4})), "ANALYZE"));
  VolumeRequest request;
  request.extent = kExtent;
  EXPECT_TRUE(contains(refuse(Header(1), request), "--dims"));
}

TEST_F(Nifti, HostileHeaders) {
  constexpr std::int64_t huge = std::numeric_limits<std::int64_t>::max();
  refuse(Header(1).dims({0}));
  refuse(Header(1).dims({8}));
  refuse(Header(1).dims({3, -7}));
  refuse(Header(1).dims({3, 0}));
  refuse(Header(2).dims({3, huge, huge, huge}));
  refuse(Header(2).dims({4, 7, 5, 4, huge}));
  EXPECT_TRUE(contains(refuse(Header(1).dims({3, 32767, 32767, 32767})), "promises"));
  refuse(Header(1).put<float>(108, -1));
  refuse(Header(1).put<float>(108, std::numeric_limits<float>::quiet_NaN()));
  refuse(Header(1).put<float>(108, 1e30f));
  refuse(Header(1).put<float>(108, 100));
  refuse(Header(1).scale(1, std::numeric_limits<double>::infinity()));
  refuse(Header(1).sform(1));  // all zero
  refuse(Header(1).qform(1).real(256, 352, {1, 1, 1}));
  refuse(Header(1).qform(1));  // no spacing
  const std::string packed = gzip(Header(2).dims({3, 100000, 100000, 100000}).bytes());
  EXPECT_TRUE(contains(message_of([&] { open(packed); }), "at most"));
  EXPECT_TRUE(contains(message_of([&] { open(Header(1).bytes() + samples().substr(1)); }), "631"));
  const std::string whole = gzip(Header(1).bytes() + samples());
  for (const std::size_t size : {30u, 100u, 200u, 400u}) {
    const TempDir other;
    const auto path = other.write("v.nii.gz", whole.substr(0, std::min(size, whole.size() - 9u)));
    try {
      read_box(*open_source(path, {}), kWhole);
      ADD_FAILURE() << size;
    } catch (const Error& error) {
      EXPECT_TRUE(contains(error.what(), path)) << error.what();
    }
  }
}

TEST_F(Nifti, Mutations) {
  for (const int version : {1, 2}) {
    const std::string bytes =
        Header(version).scale(2, 1).qform(1).real(76, 104, {1, 1, 2, 3}).bytes() + samples();
    expect_mutations_are_no_crash(dir, "m.nii", bytes);
    expect_mutations_are_no_crash(dir, "m.nii.gz", gzip(bytes));
  }
}

}  // namespace
}  // namespace isobrick

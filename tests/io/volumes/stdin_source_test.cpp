#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <thread>

#include <isobrick/open_source.h>
#include "test_samples.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

constexpr Int3 kExtent{50, 40, 30};
constexpr Box3 kWhole{{0, 0, 0}, kExtent};

/// Standard input is a pipe that `bytes` come through, for as long as this lives.
class StdinPipe {
 public:
  explicit StdinPipe(std::string bytes) : saved_(::dup(STDIN_FILENO)) {
    int ends[2];
    if (::pipe(ends) != 0) throw std::runtime_error("no pipe");
    ::dup2(ends[0], STDIN_FILENO);
    ::close(ends[0]);
    writer_ = std::thread([to = ends[1], bytes = std::move(bytes)] {
      for (std::size_t at = 0; at < bytes.size();) {
        const ssize_t put = ::write(to, bytes.data() + at, bytes.size() - at);
        if (put < 0) break;
        at += static_cast<std::size_t>(put);
      }
      ::close(to);
    });
  }
  ~StdinPipe() {
    // Empty the pipe, so that the writer comes to its end.
    char ignored[4096];
    while (::read(STDIN_FILENO, ignored, sizeof(ignored)) > 0) continue;
    writer_.join();
    if (saved_ >= 0) {
      ::dup2(saved_, STDIN_FILENO);
      ::close(saved_);
    }
  }

 private:
  int saved_;
  std::thread writer_;
};

VolumeRequest said_type(ScalarType type) {
  VolumeRequest request;
  request.extent = kExtent;
  request.type = type;
  return request;
}

TEST(StdinSource, PlanesInOrder) {
  const StdinPipe pipe(sample_bytes(ScalarType::f32, kWhole, kExtent));
  const auto source = open_source("-", said_type(ScalarType::f32));
  EXPECT_FALSE(source->random_access());
  EXPECT_EQ(source->info().name, "standard input");
  for (const auto& [z0, z1] : {std::pair{0, 7}, {7, 8}, {8, 30}}) {
    const Box3 box{{0, 0, z0}, {kExtent.x, kExtent.y, z1}};
    EXPECT_EQ(read_box(*source, box), sample_bytes(ScalarType::f32, box, kExtent));
  }
}

TEST(StdinSource, OffsetByteOrderAndSkippedPlanes) {
  const StdinPipe pipe(std::string(100000, '!') +
                       sample_bytes(ScalarType::u16, kWhole, kExtent, true));
  VolumeRequest request = said_type(ScalarType::u16);
  request.offset = 100000;
  request.order = ByteOrder::big;
  const auto source = open_source("-", request);
  const Box3 box{{0, 0, 20}, kExtent};
  EXPECT_EQ(read_box(*source, box), sample_bytes(ScalarType::u16, box, kExtent));
}

TEST(StdinSource, TooShort) {
  const StdinPipe pipe(std::string(59999, 'x'));
  const auto source = open_source("-", said_type(ScalarType::u8));
  const auto message = message_of([&] { read_box(*source, kWhole); });
  EXPECT_TRUE(contains(message, "59999") && contains(message, "60000")) << message;
}

TEST(StdinSource, TooLong) {
  const StdinPipe pipe(std::string(60003, 'x'));
  const auto source = open_source("-", said_type(ScalarType::u8));
  EXPECT_NO_THROW(read_box(*source, {{0, 0, 0}, {50, 40, 29}}));
  const auto message = message_of([&] { read_box(*source, {{0, 0, 29}, kExtent}); });
  EXPECT_TRUE(contains(message, "60000") && contains(message, ": 3 more")) << message;
}

TEST(StdinSource, MuchTooLongIsNotReadToItsEnd) {
  const StdinPipe pipe(std::string(60000 + (3 << 20), 'x'));
  const auto source = open_source("-", said_type(ScalarType::u8));
  EXPECT_TRUE(contains(message_of([&] { read_box(*source, kWhole); }), "at least 1048576 more"));
}

TEST(StdinSource, ExtentAndTypeMustBeSaid) {
  const StdinPipe pipe("");
  const auto ends_with = [](const VolumeRequest& request, const char* end) {
    const auto message = message_of([&] { open_source("-", request); });
    EXPECT_TRUE(contains(message, "standard input") && message.ends_with(end)) << message;
  };
  ends_with({}, "add --dims X,Y,Z --type TYPE");
  ends_with({.extent = kExtent}, "the type of standard input is not known: add --type TYPE");
  ends_with({.type = ScalarType::u8},
            "the extent of standard input is not known: add --dims X,Y,Z");
}

}  // namespace
}  // namespace isobrick

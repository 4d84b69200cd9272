#include "bricks/storage/remote_storage.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <thread>

#include <isobrick/error.h>
#include "tests/bricks/storage/fake_client.h"

namespace isobrick {
namespace {

using test::Bytes;
using test::FakeClient;
using test::noise;

class RemoteStorageTest : public testing::Test {
 protected:
  static constexpr std::size_t kSize = 10 << 20;

  RemoteStorageTest() {
    client_->objects["http://host/x.zarr/large"] = large_;
    client_->objects["http://host/x.zarr/a%20b"] = noise(100);
    client_->objects["http://host/x.zarr/empty"] = {};
  }

  std::shared_ptr<const Storage> open(std::uint64_t memory = 4 << 20) {
    RemoteOptions options;
    options.memory = memory;
    return remote_storage("http://host/x.zarr", options, client_);
  }
  void expect_bytes(const StoredObject& object, std::uint64_t offset, std::size_t size) {
    Bytes read(size);
    object.read(offset, read);
    EXPECT_TRUE(
        std::equal(read.begin(), read.end(), large_.begin() + static_cast<std::ptrdiff_t>(offset)))
        << offset << " + " << size;
  }

  const Bytes large_ = noise(kSize);
  std::shared_ptr<FakeClient> client_ = std::make_shared<FakeClient>();
};

TEST_F(RemoteStorageTest, SizesAndBytes) {
  const auto storage = open();
  EXPECT_TRUE(storage->is_remote());
  EXPECT_EQ(storage->open("nothing"), nullptr);
  const auto large = storage->open("large"), small = storage->open("a b"),
             empty = storage->open("empty");
  ASSERT_TRUE(large && small && empty);
  EXPECT_EQ(large->size(), kSize);
  EXPECT_EQ(small->size(), 100U);
  EXPECT_EQ(empty->size(), 0U);
  EXPECT_EQ(large->name(), "http://host/x.zarr/large");
  expect_bytes(*large, 0, 10);
  expect_bytes(*large, 65530, 100);  // over the end of what came with the size
  expect_bytes(*large, 1000, kSize - 1000);
  Bytes bytes(11);
  EXPECT_THROW(large->read(kSize - 10, bytes), DamageError);
}

TEST_F(RemoteStorageTest, SmallObjectsComeWithTheirSize) {
  const auto storage = open();
  const auto small = storage->open("a b");
  Bytes bytes(100);
  for (int i = 0; i < 3; ++i) small->read(0, bytes);
  EXPECT_EQ(bytes, noise(100));
  EXPECT_EQ(storage->open("a b"), small);
  EXPECT_EQ(client_->take_ranges().size(), 1U);
}

TEST_F(RemoteStorageTest, CloseHintsAreOneRequest) {
  const auto storage = open();
  const auto large = storage->open("large");
  client_->take_ranges();
  large->will_need(1 << 20, 1000);
  large->will_need((1 << 20) + 5000, 1000);
  large->will_need(3 << 20, 1000);
  large->will_need((1 << 20) + 1000, 500);
  const auto ranges = client_->take_ranges();
  ASSERT_EQ(ranges.size(), 2U);
  EXPECT_EQ(ranges[0].offset, 1U << 20);
  EXPECT_EQ(ranges[0].size, 6000U);
  expect_bytes(*large, 1 << 20, 1000);
  expect_bytes(*large, (1 << 20) + 5000, 1000);
  expect_bytes(*large, (1 << 20) + 1000, 500);
  expect_bytes(*large, 3 << 20, 1000);
  EXPECT_TRUE(client_->take_ranges().empty());
  expect_bytes(*large, 3 << 20, 1000);  // read once: dropped
  EXPECT_EQ(client_->take_ranges().size(), 1U);
}

TEST_F(RemoteStorageTest, HintsWaitForRoom) {
  const auto storage = open(1 << 20);
  const auto large = storage->open("large");
  client_->take_ranges();
  constexpr std::size_t kBrick = 200000;
  constexpr int kCount = 20;
  const auto at = [](int i) { return static_cast<std::uint64_t>(i) * 2 * kBrick; };
  for (int i = 0; i < kCount; ++i) large->will_need(at(i), kBrick);
  EXPECT_EQ(client_->take_ranges().size(), 5U);  // as much as the memory holds
  for (int i = 0; i < kCount; ++i) {
    expect_bytes(*large, at(i), kBrick);
    client_->settle();
  }
  // Each was fetched once.
  EXPECT_EQ(client_->take_ranges().size(), kCount - 5U);
}

TEST_F(RemoteStorageTest, WhatWaitsForRoomIsReadAtOnce) {
  const auto storage = open(1 << 20);
  const auto large = storage->open("large");
  for (int i = 0; i < 20; ++i) large->will_need(static_cast<std::uint64_t>(i) * 400000, 200000);
  expect_bytes(*large, 19 * 400000, 200000);
}

TEST_F(RemoteStorageTest, ManyThreads) {
  const auto storage = open();
  const auto large = storage->open("large");
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 200; ++i) {
        const auto offset = static_cast<std::uint64_t>((i * 7 + t * 13) % 100) * 100000;
        if (i % 2 == t % 2) large->will_need(offset, 30000);
        if (i % 3 == 0) client_->settle();
        expect_bytes(*large, offset, 30000);
      }
    });
  for (std::thread& thread : threads) thread.join();
}

TEST_F(RemoteStorageTest, WrongRepliesAreRefused) {
  const auto storage = open();
  const auto large = storage->open("large");
  Bytes bytes(1000);
  const auto expect_error = [&](const std::string& part) {
    try {
      large->read(1 << 20, bytes);
      ADD_FAILURE() << "no error: " << part;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
      EXPECT_NE(std::string(e.what()).find("x.zarr/large"), std::string::npos) << e.what();
    }
  };
  client_->change = [](const HttpRequest&, HttpReply& reply) { reply.body.pop_back(); };
  expect_error("999 bytes in place of 1000");
  client_->change = [](const HttpRequest&, HttpReply& reply) {
    reply.headers["content-range"] = "bytes 0-999/10485760";
  };
  expect_error("in place of 'bytes 1048576-1049575/10485760'");
  client_->change = [](const HttpRequest&, HttpReply& reply) { reply.status = 200; };
  expect_error("ranges of bytes");
  client_->change = [](const HttpRequest& request, HttpReply& reply) {
    EXPECT_EQ(request.headers.at(0), "If-Match: \"1\"");
    reply.status = 412;
  };
  expect_error("was changed");
  // A hint that failed is no reason to fail: the read tries again.
  large->will_need(1 << 20, 1000);
  client_->settle();
  client_->change = {};
  expect_bytes(*large, 1 << 20, 1000);
}

TEST_F(RemoteStorageTest, AFailedOpenIsTriedAgain) {
  const auto storage = open();
  client_->change = [](const HttpRequest&, HttpReply& reply) { reply.status = 402; };
  EXPECT_THROW(storage->open("large"), Error);
  client_->change = {};
  EXPECT_NE(storage->open("large"), nullptr);
}

TEST_F(RemoteStorageTest, MayEndBeforeItsReplies) {
  for (int i = 0; i < 50; ++i) {
    const auto storage = open();
    storage->will_open("large");
    const auto large = storage->open("large");
    large->will_need(1 << 20, 1 << 20);
    if (i % 2 == 0) client_->settle();
  }
}

}  // namespace
}  // namespace isobrick

#include <gtest/gtest.h>

#include "isobrick/gpu/device.h"
#include "isobrick/gpu/spare_pages.h"
#include "isobrick/pipeline/backend_choice.h"
#include "tests/pipeline/convert_store.h"
#include "tests/pipeline/no_sink.h"

// Page-locked memory that an extraction has left is part of no budget.

namespace isobrick::test {
namespace {

class SpareMemory : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!gpu::device_available()) GTEST_SKIP() << "no CUDA device";
    gpu::open_device(0);
    MemorySource source = make_source<std::uint8_t>({60, 60, 60}, 1);
    convert_quietly(source, folder_ / "a", {.brick = 16, .shard = 32});
    store_ = std::make_unique<StoreReader>(folder_ / "a");
    request_ = check_request(*store_, options_, Indexing::welded);
    leave_some();
  }

  /// As an extraction of other sizes does.
  static void leave_some() {
    gpu::LockedPieces pieces(0, {4096});
    gpu::MappedPages::touch(pieces.at(0), pieces.bytes(0));
    pieces.lock_next();
    gpu::spare_pages().keep_only(0, {{4096}});
    gpu::spare_pages().give(std::move(pieces));
    EXPECT_EQ(gpu::spare_pages().bytes(), 4096u);
  }

  TemporaryFolder folder_;
  std::unique_ptr<StoreReader> store_;
  const ExtractOptions options_{.isovalue = 100, .memory = std::uint64_t{400} << 20, .threads = 2};
  ExtractRequest request_;
  NoSink sink_;
};

TEST_F(SpareMemory, GoesBeforeTheCpuMakesASurface) {
  const ChosenBackend chosen = set_up_backend(
      request_, options_, 64, 0, sink_, [] { return nullptr; },
      [](const ExtractPlan&, GpuSession&) { return nullptr; });
  EXPECT_TRUE(chosen.surface);
  EXPECT_EQ(gpu::spare_pages().bytes(), 0u);
}

TEST_F(SpareMemory, GoesWhenAGpusSurfaceIsPlannedThatDoesNotUseIt) {
  (void)open_gpu(0)->plan(request_, 0, options_.memory, 0, 64);
  EXPECT_EQ(gpu::spare_pages().bytes(), 0u);
}

}  // namespace
}  // namespace isobrick::test

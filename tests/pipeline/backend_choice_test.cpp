#include "pipeline/extract/backend_choice.h"

#include <gtest/gtest.h>

#include <isobrick/error.h>
#include "pipeline/program_memory.h"
#include "tests/pipeline/convert_store.h"
#include "tests/pipeline/no_sink.h"
#include "tests/stream/heap_memory.h"

namespace isobrick::test {
namespace {

class NoSurface final : public SurfaceExtractor {
 public:
  void extract(std::span<const TileWork>, const BrickLookup&,
               const std::shared_ptr<const void>&) override {}
  void finish() override {}
  SurfaceReport report() const override { return {}; }
};

/// A GPU that is busy or small, or neither; `pinned` is what a surface takes of the host's memory.
class FakeGpu final : public GpuSession {
 public:
  FakeGpu(std::uint64_t pinned, bool full) : pinned_(pinned), full_(full) {}

  std::uint64_t plan(PassRequests requests, std::uint64_t, std::uint64_t host_budget,
                     std::uint64_t other, std::uint64_t) override {
    const std::uint64_t pinned = requests.size() * pinned_;
    if (host_budget < other + pinned) throw UsageError("--memory is too small for the GPU");
    return pinned;
  }
  std::size_t preferred_batch() const override { return 8; }
  std::size_t pool_bricks() const override { return 0; }
  BrickMemory& bricks() override { return bricks_; }
  std::unique_ptr<SurfaceExtractor> make_surface(const ExtractRequest&, std::size_t,
                                                 MeshSink&) override {
    if (full_) {
      // Decoding is to be stopped in the middle, not before it has begun.
      bricks_.wait_for_demand();
      throw Error("no device memory is left");
    }
    return std::make_unique<NoSurface>();
  }
  void report(ExtractReport&) const override {}

 private:
  std::uint64_t pinned_;
  bool full_;
  HeapMemory bricks_;
};

class BackendChoice : public ::testing::Test {
 protected:
  void SetUp() override {
    MemorySource source = make_source<std::uint8_t>({60, 60, 60}, 1);
    convert_quietly(source, folder_ / "a", {.brick = 16, .shard = 32});
    store_ = std::make_unique<StoreReader>(folder_ / "a");
  }

  ChosenBackend choose(Backend backend, std::uint64_t memory, const OpenGpu& open,
                       std::size_t surfaces = 1) {
    const ExtractOptions options{
        .isovalue = 100, .memory = memory, .threads = 2, .backend = backend};
    std::vector<ExtractRequest> requests(surfaces,
                                         check_request(*store_, options, Indexing::welded));
    for (std::size_t i = 0; i < surfaces; ++i) {
      requests[i].surface.isovalue += static_cast<double>(i);
      requests[i].active_bricks = 64;
    }
    const std::vector<MeshSink*> sinks(surfaces, &sink_);
    return set_up_backend(requests, options, 0, sinks, open,
                          [&](PassRequests of_pass, const ExtractPlan& plan, GpuSession& gpu) {
                            return std::make_unique<DecodedTiles>(*store_, 0,
                                                                  tiles_of(*store_, 0, of_pass),
                                                                  of_pass, plan, gpu.bricks());
                          });
  }

  TemporaryFolder folder_;
  std::unique_ptr<StoreReader> store_;
  NoSink sink_;
};

OpenGpu gpu(std::uint64_t pinned, bool full = false) {
  return [=] { return std::make_unique<FakeGpu>(pinned, full); };
}

TEST_F(BackendChoice, AGpuThatWorksIsTaken) {
  for (const Backend backend : {Backend::automatic, Backend::cuda}) {
    const ChosenBackend chosen = choose(backend, 400 * kMiB, gpu(100 * kMiB));
    EXPECT_TRUE(chosen.gpu);
    EXPECT_EQ(chosen.surfaces.size(), 1u);
    EXPECT_EQ(chosen.gpu_refusal, "");
    ASSERT_TRUE(chosen.decoded);
    const auto batch = chosen.decoded->decoder.next();
    ASSERT_TRUE(batch);
    EXPECT_FALSE(batch->tiles().empty());
  }
  const ChosenBackend cpu = choose(Backend::automatic, 400 * kMiB, [] { return nullptr; });
  EXPECT_FALSE(cpu.gpu);
  EXPECT_FALSE(cpu.decoded);
  EXPECT_EQ(cpu.surfaces.size(), 1u);
  EXPECT_EQ(cpu.gpu_refusal, "");
}

TEST_F(BackendChoice, TheCpuStepsInForAnAutomaticGpuAndSaysWhy) {
  const OpenGpu lost = []() -> std::unique_ptr<GpuSession> { throw Error("the device is busy"); };
  const auto expect_cpu = [&](std::uint64_t memory, const OpenGpu& open, const std::string& why) {
    const ChosenBackend chosen = choose(Backend::automatic, memory, open);
    EXPECT_FALSE(chosen.gpu);
    EXPECT_FALSE(chosen.decoded);
    EXPECT_EQ(chosen.surfaces.size(), 1u);
    EXPECT_LE(chosen.plan.bytes, memory);
    EXPECT_EQ(chosen.gpu_refusal, why);
  };
  expect_cpu(400 * kMiB, lost, "the device is busy");
  expect_cpu(100 * kMiB, gpu(100 * kMiB), "--memory is too small for the GPU");
  expect_cpu(400 * kMiB, gpu(kMiB, true), "no device memory is left");
  EXPECT_THROW(choose(Backend::automatic, kMiB, gpu(kMiB)), UsageError);
}

TEST_F(BackendChoice, AsManySurfacesAsFitAreSetUpTogether) {
  // The driver and decoding take some 160 MiB, each surface 100.
  for (const auto& [memory, expected] :
       {std::pair(600 * kMiB, 4u), std::pair(400 * kMiB, 2u), std::pair(300 * kMiB, 1u)}) {
    const ChosenBackend chosen = choose(Backend::cuda, memory, gpu(100 * kMiB), 4);
    EXPECT_EQ(chosen.surfaces.size(), expected) << memory;
    const auto batch = chosen.decoded->decoder.next();
    ASSERT_TRUE(batch);
    EXPECT_FALSE(batch->tiles_of(expected - 1).empty());
  }
  EXPECT_THROW(choose(Backend::cuda, 200 * kMiB, gpu(100 * kMiB), 4), UsageError);
  EXPECT_EQ(choose(
                Backend::cpu, 400 * kMiB, [] { return nullptr; }, 4)
                .surfaces.size(),
            4u);
  const ChosenBackend tight = choose(
      Backend::cpu, 48 * kMiB, [] { return nullptr; }, 4);
  EXPECT_GE(tight.surfaces.size(), 1u);
  EXPECT_LT(tight.surfaces.size(), 4u);
  EXPECT_LE(tight.plan.bytes, 48 * kMiB);
}

TEST_F(BackendChoice, AGpuThatIsDemandedFailsAloud) {
  EXPECT_THROW(choose(Backend::cuda, 100 * kMiB, gpu(100 * kMiB)), UsageError);
  EXPECT_THROW(choose(Backend::cuda, 400 * kMiB, gpu(kMiB, true)), Error);
}

TEST_F(BackendChoice, SeveralIsovaluesOfWeldedMeshesMayShareWhatStaysOnTheGpu) {
  const auto request = [&](double isovalue, auto... change) {
    ExtractRequest r = check_request(*store_, {.isovalue = isovalue}, Indexing::welded);
    (change(r.surface), ...);
    return r;
  };
  const auto local = [](SurfaceOptions& s) { s.indexing = Indexing::chunk_local; };
  const auto dropping = [](SurfaceOptions& s) { s.drop_degenerate = true; };
  const auto normals = [](SurfaceOptions& s) { s.normals = true; };
  using Requests = std::vector<ExtractRequest>;
  EXPECT_TRUE(can_be_resident(Requests{request(100), request(120, normals)}));
  EXPECT_FALSE(can_be_resident(Requests{request(100)}));
  EXPECT_FALSE(can_be_resident(Requests{request(100), request(100, normals)}));
  EXPECT_FALSE(can_be_resident(Requests{request(100), request(120, local)}));
  EXPECT_TRUE(can_be_resident(Requests{request(100, dropping), request(120)}));
}

TEST_F(BackendChoice, APassOverWhatStaysOnTheGpuKeepsToTheHostsBudget) {
  std::vector<ExtractRequest> requests(3, check_request(*store_, {.threads = 2}, Indexing::welded));
  for (ExtractRequest& request : requests) request.active_bricks = 64;
  std::uint64_t chunk = 0;
  for (const std::uint64_t budget : {180 * kMiB, 256 * kMiB, 1024 * kMiB, 8192 * kMiB}) {
    const auto plan = plan_resident_memory(requests, budget, 0);
    ASSERT_TRUE(plan) << budget;
    EXPECT_LE(plan->bytes, budget);
    EXPECT_GE(plan->limits.output_bytes, chunk);
    EXPECT_GE(plan->limits.tiles * 32768, plan->limits.output_bytes / 2) << "tiles of a byte";
    chunk = plan->limits.output_bytes;
  }
  EXPECT_EQ(chunk, 32 * kMiB);
  EXPECT_FALSE(plan_resident_memory(requests, 120 * kMiB, 0)) << "the driver alone takes that";
  // As many sinks are written at a time as there is memory for.
  EXPECT_EQ(plan_resident_memory(requests, 180 * kMiB, 0)->sinks, 3u);
  for (ExtractRequest& request : requests) request.sink_bytes = 300 * kMiB;
  EXPECT_EQ(plan_resident_memory(requests, 2048 * kMiB, 0)->sinks, 3u);
  EXPECT_EQ(plan_resident_memory(requests, 900 * kMiB, 0)->sinks, 2u);
  EXPECT_EQ(plan_resident_memory(requests, 600 * kMiB, 0)->sinks, 1u);
  EXPECT_FALSE(plan_resident_memory(requests, 300 * kMiB, 0));
}

}  // namespace
}  // namespace isobrick::test

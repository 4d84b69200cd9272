#include "isobrick/gpu/tile_kernel.h"

#include "isobrick/core/error.h"
#include "isobrick/core/threshold.h"
#include "isobrick/gpu/cuda_check.h"
#include "isobrick/gpu/device_scalar.h"
#include "isobrick/gpu/extract_tiles.cuh"

namespace isobrick::gpu {
namespace {

int device_attribute(cudaDeviceAttr attribute) {
  int device = 0, value = 0;
  check(cudaGetDevice(&device));
  check(cudaDeviceGetAttribute(&value, attribute, device));
  return value;
}

/// How many blocks fill the device, and how they are launched.
template <int N, class T, bool Normals, bool Nan = false>
struct Launcher {
  static constexpr auto kKernel = extract_tiles<N, T, Normals, Nan>;
  static constexpr int kSlabs = Team<N>::kSlabs;
  static bool before_ampere() { return device_attribute(cudaDevAttrComputeCapabilityMajor) < 8; }
  static std::uint32_t listed() {
    return before_ampere() ? kListedBeforeAmpere : Team<N>::kMostListed;
  }
  static std::size_t shared() {
    constexpr bool kSlab = kSlabs > 1;
    return before_ampere() ? kSharedBytes<kListedBeforeAmpere, Nan, kSlab>
                           : kSharedBytes<Team<N>::kMostListed, Nan, kSlab>;
  }
  /// 0 where the device has too little shared memory for one.
  static int blocks() {
    const std::size_t bytes = shared();
    if (static_cast<std::size_t>(device_attribute(cudaDevAttrMaxSharedMemoryPerBlockOptin)) < bytes)
      return 0;
    check(cudaFuncSetAttribute(kKernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                               static_cast<int>(bytes)));
    int each = 0;
    check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kKernel, N, bytes));
    return each * device_attribute(cudaDevAttrMultiProcessorCount);
  }
  /// Code for older devices does not wait by itself (wait_for_launch_before).
  static bool may_start_early() {
    cudaFuncAttributes attributes{};
    check(cudaFuncGetAttributes(&attributes, kKernel));
    return attributes.ptxVersion >= 90;
  }
  static void launch(const TileParams& params, const CaseTable* cases, const LaunchShape& shape,
                     cudaStream_t stream, bool start_early, KernelGraph* graph) {
    T threshold = Threshold<T>(params.isovalue).value;
    if (graph) {
      void* arguments[] = {const_cast<TileParams*>(&params), &threshold, &cases};
      cudaKernelNodeParams node{};
      node.func = reinterpret_cast<void*>(kKernel);
      node.gridDim = dim3(static_cast<unsigned>(shape.blocks));
      node.blockDim = dim3(N);
      node.sharedMemBytes = static_cast<unsigned>(shape.shared_bytes);
      node.kernelParams = arguments;
      graph->launch("extract_tiles", node, stream);
      return;
    }
    cudaLaunchAttribute early{};
    early.id = cudaLaunchAttributeProgrammaticStreamSerialization;
    early.val.programmaticStreamSerializationAllowed = 1;
    cudaLaunchConfig_t config{};
    config.gridDim = static_cast<unsigned>(shape.blocks);
    config.blockDim = N;
    config.dynamicSmemBytes = shape.shared_bytes;
    config.stream = stream;
    config.attrs = &early;
    config.numAttrs = start_early ? 1 : 0;
    check(cudaLaunchKernelEx(&config, kKernel, params, threshold, cases));
    check_launch("extract_tiles");
  }
};

template <int N, class F>
auto visit_launcher_of(ScalarType type, bool normals, F&& f) {
  return visit_device_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    return normals ? f(Launcher<N, T, true>()) : f(Launcher<N, T, false>());
  });
}

/// Numbers of threads that have kernels for everything but NaN, and others for bytes
/// without normals only.
constexpr int kTeams[3] = {1024, 640, 384}, kByteTeams[5] = {32, 64, 128, 256, 512};
constexpr int kNanTeam = 384;

template <class F>
auto visit_launcher(const TileKernel& kernel, int threads, F&& f) {
  const auto [type, normals, nan] = kernel;
  using Byte = std::uint8_t;
  if (nan)
    return normals ? f(Launcher<kNanTeam, float, true, true>())
                   : f(Launcher<kNanTeam, float, false, true>());
  switch (threads) {
    case 32: return f(Launcher<32, Byte, false>());
    case 64: return f(Launcher<64, Byte, false>());
    case 128: return f(Launcher<128, Byte, false>());
    case 256: return f(Launcher<256, Byte, false>());
    case 512: return f(Launcher<512, Byte, false>());
    case kSlabTeam: return visit_launcher_of<kSlabTeam>(type, normals, f);
    case 640: return visit_launcher_of<640>(type, normals, f);
    case 1024: return visit_launcher_of<1024>(type, normals, f);
    default: return visit_launcher_of<384>(type, normals, f);
  }
}

void check_threads(const TileKernel& kernel, int threads) {
  for (const int known : kTeams)
    if (threads == known && (!kernel.may_have_nan || known == kNanTeam)) return;
  for (const int known : kByteTeams)
    if (threads == known && kernel.type == ScalarType::u8 && !kernel.normals) return;
  throw UsageError(
      "384, 640 or 1024 threads share a tile, where there may be NaN 384, and for u8 without "
      "normals also 32, 64, 128, 256 or 512");
}

}  // namespace

LaunchShapes launch_shapes(const TileKernel& kernel, int threads) {
  if (threads > 0) check_threads(kernel, threads);
  const auto shape_of = [&](int team) {
    return visit_launcher(kernel, team, [&](auto l) {
      const int processors = device_attribute(cudaDevAttrMultiProcessorCount);
      return LaunchShape{l.blocks(), team,       l.kSlabs,           l.shared(),
                         l.listed(), processors, l.may_start_early()};
    });
  };
  LaunchShapes shapes;
  for (int i = 0; i < 3; ++i)
    shapes.shapes[i] = shape_of(threads > 0 ? threads : kernel.may_have_nan ? kNanTeam : kTeams[i]);
  if (threads == 0 && !kernel.may_have_nan) shapes.slabs = shape_of(kSlabTeam);
  if (shapes.shapes[2].blocks == 0)
    throw Error("the device has too little shared memory for the extraction kernel");
  return shapes;
}

LaunchShape LaunchShapes::of(std::uint32_t tiles, std::uint64_t cells) const {
  const auto threads_at_work = [](const LaunchShape& s) { return s.blocks * s.threads; };
  const LaunchShape* best = &shapes[2];
  if (cells > best->listed && shapes[1].blocks > 0 && shapes[1].listed > best->listed)
    best = &shapes[1];
  // Where shared memory is scarce, a larger team keeps more threads at work.
  for (const LaunchShape& shape : shapes)
    if (threads_at_work(shape) > 2 * threads_at_work(*best)) best = &shape;
  for (const LaunchShape& shape : shapes)
    if (shape.blocks > 0 && tiles <= static_cast<std::uint32_t>(shape.blocks)) return shape;
  return *best;
}

LaunchShape LaunchShapes::in_slabs(std::uint32_t tiles) const {
  const auto blocks = static_cast<std::uint32_t>(slabs.blocks);
  return tiles <= kMostActiveInSlabs && tiles * kSlabsOfTile <= blocks ? slabs : of(tiles);
}

void launch_extraction(const TileKernel& kernel, const TileParams& params, const CaseTable* cases,
                       LaunchShape shape, cudaStream_t stream, bool after_search,
                       KernelGraph* graph) {
  visit_launcher(kernel, shape.threads, [&](auto l) {
    l.launch(params, cases, shape, stream, after_search && shape.may_start_early, graph);
  });
}

}  // namespace isobrick::gpu

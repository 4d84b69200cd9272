#include "tests/gpu/kernels/tile_runner.h"

#include "tests/gpu/kernels/cuda_language.h"  // before what is written in it

#include <stdexcept>

#include "core/threshold.h"
#include "gpu/resident/array_blocks.cuh"
#include "gpu/resident/array_ranges.cuh"
#include "gpu/resident/gather_tiles.cuh"
#include "gpu/search/search_tiles.cuh"
#include "gpu/stream/unpack_tiles.cuh"
#include "gpu/tile/extract_tiles.cuh"

namespace isobrick::emulated {
namespace {

template <int N, class T, bool Normals, bool Nan, gpu::TileExtra Extra = gpu::TileExtra::none>
struct Kernel {
  static constexpr std::uint32_t kListed = gpu::ListsOf<N>::kListed;

  static void run(const TileRun& r, const gpu::TileParams& params, const gpu::CaseTable& cases) {
    const T threshold = Threshold<T>(params.isovalue).value;
    launch(r.blocks, N, gpu::kSharedBytes<kListed, Nan>, r.seed,
           [&] { gpu::extract_tiles<N, T, Normals, Nan, Extra>(params, threshold, &cases); });
  }
};

/// Calls f(TypeTag<T>, order) with the order as a type.
template <class F>
void visit_order(ScalarType type, const gpu::ArrayParams& array, F&& f) {
  visit_scalar(type, [&](auto tag) {
    using enum gpu::ArrayOrder;
    switch (gpu::array_order(array, sizeof(typename decltype(tag)::type))) {
      case vectors: return f(tag, std::integral_constant<gpu::ArrayOrder, vectors>());
      case along_x: return f(tag, std::integral_constant<gpu::ArrayOrder, along_x>());
      case along_y: return f(tag, std::integral_constant<gpu::ArrayOrder, along_y>());
      case along_z: return f(tag, std::integral_constant<gpu::ArrayOrder, along_z>());
    }
  });
}

template <class T, class F>
auto with_nan_kernel(const TileRun& r, F& f) {
  return r.normals ? f(Kernel<384, T, true, true>()) : f(Kernel<384, T, false, true>());
}

template <class F>
auto with_kernel(const TileRun& r, F&& f) {
  if (r.on_samples)
    return visit_scalar(r.type, [&](auto tag) {
      using T = typename decltype(tag)::type;
      using gpu::TileExtra;
      if (r.trilinear)
        return r.normals ? f(Kernel<384, T, true, true, TileExtra::both>())
                         : f(Kernel<384, T, false, true, TileExtra::both>());
      return r.normals ? f(Kernel<384, T, true, true, TileExtra::on_samples>())
                       : f(Kernel<384, T, false, true, TileExtra::on_samples>());
    });
  if (r.trilinear)
    return visit_scalar(r.type, [&](auto tag) {
      using T = typename decltype(tag)::type;
      using gpu::TileExtra;
      if constexpr (std::is_floating_point_v<T>)
        if (r.may_have_nan)
          return r.normals ? f(Kernel<384, T, true, true, TileExtra::trilinear>())
                           : f(Kernel<384, T, false, true, TileExtra::trilinear>());
      return r.normals ? f(Kernel<384, T, true, false, TileExtra::trilinear>())
                       : f(Kernel<384, T, false, false, TileExtra::trilinear>());
    });
  if (r.may_have_nan)
    return r.type == ScalarType::f64 ? with_nan_kernel<double>(r, f) : with_nan_kernel<float>(r, f);
  switch (r.threads) {
    case 32: return f(Kernel<32, std::uint8_t, false, false>());
    case 640: return f(Kernel<640, std::uint8_t, false, false>());
    case 1024: return f(Kernel<1024, std::uint8_t, false, false>());
    case 384:
      return visit_scalar(r.type, [&](auto tag) {
        using T = typename decltype(tag)::type;
        return r.normals ? f(Kernel<384, T, true, false>()) : f(Kernel<384, T, false, false>());
      });
    default: throw std::invalid_argument("no such block size");
  }
}

}  // namespace

void run_tiles(const TileRun& run, const gpu::TileParams& params, const gpu::CaseTable& cases) {
  with_kernel(run, [&](auto kernel) { kernel.run(run, params, cases); });
}

void run_search(ScalarType type, const gpu::SearchParams& params, unsigned seed) {
  const unsigned blocks = (params.count + gpu::kTilesOfSearchBlock - 1) / gpu::kTilesOfSearchBlock;
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    launch(blocks, gpu::kSearchThreads, 0, seed, [&] { gpu::search_tiles<T>(params); });
  });
}

void run_tile_ranges(ScalarType type, const gpu::TileParams& params, const std::int32_t* tiles,
                     std::uint32_t count, void* ranges) {
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    launch(count, gpu::kSearchThreads, 0, 1,
           [&] { gpu::find_tile_ranges<T>(params, tiles, static_cast<T*>(ranges)); });
  });
}

void run_first_columns(ScalarType type, const void* tile_blocks, std::uint32_t count,
                       void* columns) {
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    launch(count, gpu::kSearchThreads, 0, 1, [&] {
      gpu::copy_first_columns<T>(static_cast<const T*>(tile_blocks), static_cast<T*>(columns));
    });
  });
}

void run_array_ranges(ScalarType type, const gpu::ArrayRangeParams& p, unsigned seed) {
  visit_order(type, p.array, [&](auto tag, auto order) {
    using T = typename decltype(tag)::type;
    launch(p.count, gpu::kArrayThreads, 0, seed,
           [&] { gpu::find_part_ranges<T, decltype(order)::value>(p); });
    launch((p.count + gpu::kArrayThreads - 1) / gpu::kArrayThreads, gpu::kArrayThreads, 0, seed,
           [&] { gpu::join_part_ranges<T>(p); });
  });
}

void run_load(ScalarType type, const gpu::ArrayLoadParams& p, unsigned seed) {
  launch(3, gpu::kArrayThreads, 0, seed, [&] { gpu::claim_blocks(p); });
  visit_order(type, p.array, [&](auto tag, auto order) {
    using T = typename decltype(tag)::type;
    launch(3, gpu::kArrayThreads, 0, seed, [&] { gpu::copy_tiles<T, decltype(order)::value>(p); });
  });
}

void run_gather(ScalarType type, const gpu::GatherParams& params, unsigned seed) {
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    launch(params.count, gpu::kGatherThreads, 0, seed, [&] {
      if (gpu::has_pieces<T>(params))
        gpu::gather_tiles<T, gpu::SamplePiece<T>>(params);
      else
        gpu::gather_tiles<T, T>(params);
    });
  });
}

void run_unpack(ScalarType type, const gpu::UnpackParams& params, unsigned seed) {
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    launch(params.count, gpu::kUnpackThreads, 0, seed, [&] { gpu::unpack_tiles<T>(params); });
  });
}

}  // namespace isobrick::emulated

#include "isobrick/pipeline/slab_reader.h"

#include <tbb/parallel_for.h>

#include <cstring>
#include <vector>

#include "isobrick/bricks/codec.h"
#include "isobrick/core/error.h"

namespace isobrick {
namespace {

/// A brick's samples, to be copied out row by row; an absent one is one row of
/// the fill value over and over.
class DecodedBrick {
 public:
  DecodedBrick(const StoreReader& store, int level, Int3 brick)
      : lattice_(store.info().levels[static_cast<std::size_t>(level)].lattice),
        origin_(brick * lattice_.brick) {
    buffer().resize(lattice_.brick_bytes());
    absent_ = !store.read_brick(level, brick, buffer().data());
    if (absent_) fill_row(store.info().fill_value);
  }

  const std::byte* at(Int3 p) const {
    const Index offset = absent_ ? 0 : linear_index(p - origin_, lattice_.brick);
    return buffer().data() + static_cast<std::size_t>(offset) * lattice_.sample_bytes();
  }

 private:
  static std::vector<std::byte>& buffer() {
    thread_local std::vector<std::byte> bytes;
    return bytes;
  }

  void fill_row(double fill_value) {
    const std::uint64_t bits = fill_bits(lattice_.type, fill_value);
    const std::size_t sample = lattice_.sample_bytes();
    for (std::size_t x = 0; x < static_cast<std::size_t>(lattice_.brick.x); ++x)
      std::memcpy(buffer().data() + x * sample, &bits, sample);
  }

  const Lattice& lattice_;
  Int3 origin_;
  bool absent_ = false;
};

}  // namespace

void read_slab(const StoreReader& store, int level, Box3 box, std::byte* out,
               const BrickFailure& failure) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  const Int3 edge = lattice.brick;
  const Int3 first{box.lo.x / edge.x, box.lo.y / edge.y, box.lo.z / edge.z};
  const Int3 count = ceil_div(box.hi, edge) - first;
  const auto copy = [&](Int3 brick) {
    const DecodedBrick decoded(store, level, brick);
    const Box3 shared = intersect(lattice.brick_box(brick), box);
    const std::size_t sample = lattice.sample_bytes();
    const auto row = static_cast<std::size_t>(shared.extent().x) * sample;
    for (Index z = shared.lo.z; z < shared.hi.z; ++z)
      for (Index y = shared.lo.y; y < shared.hi.y; ++y) {
        const Int3 p{shared.lo.x, y, z};
        std::memcpy(out + static_cast<std::size_t>(linear_index(p - box.lo, box.extent())) * sample,
                    decoded.at(p), row);
      }
  };
  tbb::parallel_for(Index{0}, volume(count), [&](Index i) {
    const Int3 brick = first + Int3{i % count.x, i / count.x % count.y, i / (count.x * count.y)};
    if (!failure) return copy(brick);
    try {
      copy(brick);
    } catch (const Error& e) {
      failure(brick, e.what());
    }
  });
}

}  // namespace isobrick

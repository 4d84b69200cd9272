#pragma once

#include <atomic>
#include <cstring>
#include <limits>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/range.h>
#include <isobrick/volume_source.h>

namespace isobrick::test {

inline std::size_t bytes_of(Int3 extent, ScalarType type) {
  return static_cast<std::size_t>(volume(extent)) * size_of(type);
}

/// Copies `box` out of a dense volume.
inline void copy_box(const std::byte* from, Int3 extent, std::size_t sample, Box3 box,
                     std::byte* to) {
  const auto row = static_cast<std::size_t>(box.extent().x) * sample;
  for (Index z = box.lo.z; z < box.hi.z; ++z)
    for (Index y = box.lo.y; y < box.hi.y; ++y, to += row)
      std::memcpy(to,
                  from + static_cast<std::size_t>(linear_index({box.lo.x, y, z}, extent)) * sample,
                  row);
}

/// A volume in memory that counts what is read of it, can refuse random access
/// and can fail after so many bytes.
class MemorySource : public VolumeSource {
 public:
  MemorySource(const MemorySource& other)
      : info_(other.info_), samples_(other.samples_), random_access_(other.random_access_) {}
  MemorySource(Int3 extent, ScalarType type, std::vector<std::byte> samples,
               bool random_access = true)
      : samples_(std::move(samples)), random_access_(random_access) {
    info_.extent = extent;
    info_.type = type;
    info_.name = "memory";
  }

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return random_access_; }

  void read(Box3 box, std::byte* out) override {
    if (!random_access_) {
      const Int3 e = info_.extent;
      if (box.lo.x != 0 || box.lo.y != 0 || box.hi.x != e.x || box.hi.y != e.y ||
          box.lo.z != next_z_)
        throw std::logic_error("a stream must be read in whole planes, in order, once");
      next_z_ = box.hi.z;
    }
    const auto bytes = bytes_of(box.extent(), info_.type);
    if (bytes_read_.fetch_add(bytes) + bytes > fail_after_) throw Error("the source broke");
    copy_box(samples_.data(), info_.extent, size_of(info_.type), box, out);
  }

  VolumeInfo& mutable_info() { return info_; }
  void fail_after(std::uint64_t bytes) { fail_after_ = bytes; }
  std::uint64_t bytes_read() const { return bytes_read_; }
  const std::vector<std::byte>& samples() const { return samples_; }

 private:
  VolumeInfo info_;
  std::vector<std::byte> samples_;
  bool random_access_;
  Index next_z_ = 0;
  std::uint64_t fail_after_ = ~std::uint64_t{0};
  std::atomic<std::uint64_t> bytes_read_ = 0;
};

/// Samples with structure (so that bricks compress and some are empty), over
/// the whole range of the type; floats with NaN and infinities when `odd`.
template <class T>
std::vector<T> make_samples(Int3 extent, unsigned seed, bool odd = false) {
  std::mt19937_64 random(seed);
  std::vector<T> samples(static_cast<std::size_t>(volume(extent)));
  std::size_t i = 0;
  for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
    T& v = samples[i++];
    if (p.x / 24 % 2 == 1 && p.y / 20 % 2 == 1) return;
    if constexpr (std::is_floating_point_v<T>) {
      v = static_cast<T>(static_cast<double>(random() % 20001) - 10000.0) / T{7};
      if (odd && random() % 50 == 0) {
        constexpr T inf = std::numeric_limits<T>::infinity();
        const T unusual[] = {
            std::numeric_limits<T>::quiet_NaN(), inf, -inf, T{-0.0}, std::numeric_limits<T>::max(),
            std::numeric_limits<T>::denorm_min()};
        v = unusual[random() % std::size(unusual)];
      }
    } else {
      v = static_cast<T>(random());
    }
  });
  return samples;
}

template <class T>
std::vector<std::byte> as_bytes(const std::vector<T>& v) {
  std::vector<std::byte> bytes(v.size() * sizeof(T));
  std::memcpy(bytes.data(), v.data(), bytes.size());
  return bytes;
}

/// Range by the definition: every sample of the item and of the first layers
/// of its upper neighbours.
template <class T>
ValueRange<T> brute_range(const std::vector<T>& samples, Int3 extent, Int3 item, Index edge) {
  ValueRange<T> range;
  const Int3 lo = item * edge;
  for_each_point(
      intersect({lo, lo + Int3{edge + 1, edge + 1, edge + 1}}, {{0, 0, 0}, extent}),
      [&](Int3 p) { range.include(samples[static_cast<std::size_t>(linear_index(p, extent))]); });
  return range;
}

}  // namespace isobrick::test

#pragma once

#include <cstddef>
#include <cstring>
#include <string>
#include <vector>

#include <isobrick/scalar.h>
#include <isobrick/vec.h>
#include <isobrick/volume_source.h>

namespace isobrick::inline v0 {

/// A sample whose value is its place, within every type.
template <class T>
T sample_at(Int3 p, Int3 extent) {
  const auto i = static_cast<std::uint64_t>(linear_index(p, extent)) * 2654435761u;
  if constexpr (std::is_floating_point_v<T>)
    return static_cast<T>(static_cast<double>(i % 1000003) / 7 - 1000);
  else
    return static_cast<T>(i >> 3);
}

/// The bytes of a box, in native or in the other byte order.
inline std::string sample_bytes(ScalarType type, Box3 box, Int3 extent, bool swapped = false) {
  std::string bytes;
  visit_sample(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    for_each_point(box, [&](Int3 p) {
      const T v = sample_at<T>(p, extent);
      char raw[sizeof(T)];
      std::memcpy(raw, &v, sizeof(T));
      for (std::size_t i = 0; i < sizeof(T); ++i) bytes += raw[swapped ? sizeof(T) - 1 - i : i];
    });
  });
  return bytes;
}

inline std::string read_box(VolumeSource& source, Box3 box) {
  std::vector<std::byte> bytes(static_cast<std::size_t>(volume(box.extent())) *
                               size_of(source.info().type));
  source.read(box, bytes.data());
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace isobrick

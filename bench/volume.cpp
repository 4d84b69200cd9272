#include "bench/volume.h"

#include <isobrick/open_source.h>

namespace isobrick::bench {

Volume read_all(VolumeSource& source) {
  Volume v{source.info().extent, source.info().type, {}};
  const std::size_t plane = static_cast<std::size_t>(v.extent.x * v.extent.y) * size_of(v.type);
  v.samples.resize(plane * static_cast<std::size_t>(v.extent.z));
  tbb::parallel_for(Index{0}, v.extent.z, [&](Index z) {
    source.read({{0, 0, z}, {v.extent.x, v.extent.y, z + 1}},
                v.samples.data() + static_cast<std::size_t>(z) * plane);
  });
  return v;
}

Volume read_raw(const std::string& path) { return read_all(*open_source(path, {})); }

}  // namespace isobrick::bench

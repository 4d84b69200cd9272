#include "bench/paper/volumes.h"

#include <cmath>
#include <filesystem>

#include <isobrick/synth_source.h>
#include "bench/paper/measure.h"

namespace isobrick::bench {
LoadedVolume gyroid(Int3 extent, double frequency) {
  SynthOptions options;
  options.kind = SynthKind::gyroid;
  options.extent = extent;
  options.frequency = frequency;
  options.noise = 0;
  return {read_all(*make_synth(options)), "gyroid", default_isovalue(options.type), false};
}

LoadedVolume load_raw(const std::string& path, double isovalue) {
  return {read_raw(path), std::filesystem::path(path).stem().string(), isovalue, true};
}

LoadedVolume load(const PaperVolume& paper, const std::string& folder) {
  const auto path = std::filesystem::path(folder) / paper.file;
  if (!paper.file.empty() && std::filesystem::exists(path)) {
    LoadedVolume v = load_raw(path.string(), paper.isovalue);
    v.name = paper.name;
    return v;
  }
  // A gyroid with some more triangles than wanted; away from the middle its
  // surface shrinks.
  const auto edge = static_cast<double>(std::max({paper.extent.x, paper.extent.y, paper.extent.z}));
  const double active =
      static_cast<double>(paper.triangles) / 2 / static_cast<double>(volume(paper.extent));
  LoadedVolume v = gyroid(paper.extent, std::max(1.0, 1.2 * active * edge / 4.6));
  double least = 127, most = 254;
  while (most - least > 1) {
    v.isovalue = std::floor((least + most) / 2) + 0.5;
    (count_triangles(v) > paper.triangles ? least : most) = std::floor(v.isovalue);
  }
  v.name = paper.name;
  return v;
}

}  // namespace isobrick::bench

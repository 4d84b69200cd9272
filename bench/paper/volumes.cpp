#include "bench/paper/volumes.h"

#include <tbb/parallel_for.h>

#include <cmath>
#include <filesystem>

#include "bench/paper/measure.h"
#include "isobrick/io/open_source.h"
#include "isobrick/io/synth_source.h"

namespace isobrick::bench {
namespace {

void read_all(VolumeSource& source, LoadedVolume& v) {
  v.extent = source.info().extent;
  v.type = source.info().type;
  const std::size_t plane = static_cast<std::size_t>(v.extent.x * v.extent.y) * size_of(v.type);
  v.samples.resize(plane * static_cast<std::size_t>(v.extent.z));
  const auto read = [&](Index z) {
    source.read({{0, 0, z}, {v.extent.x, v.extent.y, z + 1}},
                v.samples.data() + static_cast<std::size_t>(z) * plane);
  };
  tbb::parallel_for(Index{0}, v.extent.z, read);
}

}  // namespace

LoadedVolume gyroid(Int3 extent, double frequency) {
  SynthOptions options;
  options.kind = SynthKind::gyroid;
  options.extent = extent;
  options.frequency = frequency;
  options.noise = 0;
  LoadedVolume v;
  v.name = "gyroid";
  v.isovalue = default_isovalue(options.type);
  read_all(*make_synth(options), v);
  return v;
}

LoadedVolume read_raw(const std::string& path, double isovalue) {
  LoadedVolume v;
  v.name = std::filesystem::path(path).stem().string();
  v.isovalue = isovalue;
  v.real = true;
  read_all(*open_source(path, {}), v);
  return v;
}

LoadedVolume load(const PaperVolume& paper, const std::string& folder) {
  const auto path = std::filesystem::path(folder) / paper.file;
  if (!paper.file.empty() && std::filesystem::exists(path)) {
    LoadedVolume v = read_raw(path.string(), paper.isovalue);
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

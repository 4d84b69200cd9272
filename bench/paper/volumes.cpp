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
  // Triangles grow nearly in proportion to the frequency.
  const double cells = static_cast<double>(volume(paper.extent));
  double frequency =
      static_cast<double>(paper.triangles) / 2 / cells *
      static_cast<double>(std::max({paper.extent.x, paper.extent.y, paper.extent.z})) / 4.6;
  LoadedVolume v;
  for (int round = 0; round < 6; ++round) {
    v = gyroid(paper.extent, frequency);
    const double ratio = static_cast<double>(paper.triangles) /
                         static_cast<double>(std::max<std::uint64_t>(1, count_triangles(v)));
    if (std::abs(ratio - 1) < 0.005) break;
    frequency *= ratio;
  }
  v.name = paper.name;
  return v;
}

}  // namespace isobrick::bench

// array: three surfaces of samples in memory, which are read in place.
#include <cmath>
#include <cstdio>
#include <vector>

#include <isobrick/isobrick.h>

int main() {
  const int n = 100;
  std::vector<float> samples;  // [z, y, x]: distances from the middle
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) samples.push_back(std::hypot(x - 49.5f, y - 49.5f, z - 49.5f));
  isobrick::VolumeExtractor extractor(isobrick::Volume::of(samples.data(), {n, n, n}));
  isobrick::Mesh mesh;  // its memory is used again
  for (const double radius : {10, 20, 30}) {
    extractor.extract({.isovalue = radius, .inside = isobrick::Inside::below}, mesh);
    std::printf("radius %g: %zu triangles\n", radius, mesh.triangles.size());
    if (mesh.triangles.empty()) return 1;
  }
}

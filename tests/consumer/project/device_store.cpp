#include <cstdio>

#include <isobrick/isobrick.h>

int main(int, char** argv) {
  const auto volume = isobrick::open(argv[1]);
  const auto mesh = isobrick::extract_to_device(volume.store(), {.isovalue = 300, .normals = true});
  std::printf("%zu triangles\n", mesh.triangles().size());

  isobrick::DeviceExtractor extractor(volume.store(), {.level = 1});
  for (const double isovalue : {200.0, 300.0, 400.0}) {
    const auto coarse = extractor.extract({.isovalue = isovalue, .level = 1});
    std::printf("%g: %zu triangles\n", isovalue, coarse.triangles().size());
  }
}

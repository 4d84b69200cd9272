// store VOLUME MESH: the surface of a volume in any format, at Otsu's isovalue, as a file.
#include <cstdio>
#include <exception>

#include <isobrick/isobrick.h>

int main(int argc, char** argv) try {
  if (argc != 3) return 2;
  const auto volume = isobrick::open(argv[1]);
  const auto otsu = isobrick::parse_isovalues("otsu").front();
  const double isovalue = isobrick::resolve_isovalue(
      otsu, isobrick::histogram(volume.store(), isobrick::no_progress(), 1 << 16),
      volume.store().info().type);
  const auto mesh = isobrick::extract(volume, {.isovalue = isovalue, .normals = true});
  mesh.save(argv[2]);
  std::printf("%zu triangles at %g\n", mesh.triangles.size(), isovalue);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}

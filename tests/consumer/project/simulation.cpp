// simulation: a field that no memory holds is computed where the surface is looked for, and the
// mesh goes on chunk by chunk.
#include <cmath>
#include <cstdio>

#include <isobrick/isobrick.h>

int main() {
  isobrick::Volume field{.extent = {400, 300, 200}, .concurrent_reads = true};
  field.read = [](isobrick::Box3 box, void* out) {
    auto* sample = static_cast<float*>(out);
    isobrick::for_each_point(box, [&](isobrick::Int3 p) {
      *sample++ = std::sin(p.x * 0.05f) + std::sin(p.y * 0.05f) + std::sin(p.z * 0.05f);
    });
  };
  std::size_t triangles = 0;
  isobrick::FunctionSink sink(
      [&](const isobrick::MeshChunk& c) { triangles += c.triangles.size(); });
  isobrick::extract(field, {.isovalue = 0.5, .memory = 64 << 20}, sink);
  std::printf("%zu triangles\n", triangles);
  return triangles > 0 ? 0 : 1;
}

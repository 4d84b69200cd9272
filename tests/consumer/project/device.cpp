#include <cuda_runtime.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include <isobrick/isobrick.h>

int main() {
  const int n = 64;
  std::vector<double> field;  // every second sample along x counts
  for (int i = 0; i < n * n * 2 * n; ++i)
    field.push_back(std::hypot(i % (2 * n) / 2 - 32, i / (2 * n) % n - 32, i / (2 * n * n) - 32));
  double* samples = nullptr;
  cudaMalloc(&samples, field.size() * sizeof(double));
  cudaStream_t stream = nullptr;
  cudaStreamCreate(&stream);
  cudaMemcpyAsync(samples, field.data(), field.size() * sizeof(double), cudaMemcpyDefault, stream);

  auto array = isobrick::DeviceArray::of(samples, {n, n, n});
  array.strides = {16, 16 * n, 16 * n * n};
  array.stream = stream;
  isobrick::DeviceExtractor extractor(array);
  for (const double isovalue : {10.0, 20.0, 30.0}) {
    const auto mesh = extractor.extract({.isovalue = isovalue, .normals = true});
    // Kernels in `stream` may use mesh.positions(), mesh.normals() and mesh.triangles() now.
    std::printf("%g: %zu triangles\n", isovalue, mesh.triangles().size());
    if (mesh.download().triangles.empty()) return 1;
  }
}

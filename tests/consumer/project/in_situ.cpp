#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <isobrick/isobrick.h>

using isobrick::Index;

/// Heat in a box. Each rank has some layers of samples, and two more of either neighbour.
struct Simulation {
  static constexpr Index nx = 90, ny = 80, nz = 120, ghosts = 2, layer = nx * ny;
  int rank = 0, ranks = 1;
  Index lo = 0, hi = 0;          ///< the layers of this rank along z
  std::vector<float> now, next;  ///< from layer lo - ghosts on

  float& at(std::vector<float>& samples, Index x, Index y, Index z) const {
    return samples[static_cast<std::size_t>((z - lo + ghosts) * layer + y * nx + x)];
  }

  Simulation() {
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    lo = nz * rank / ranks;
    hi = nz * (rank + 1) / ranks;
    now.resize(static_cast<std::size_t>((hi - lo + 2 * ghosts) * layer));
    for (Index z = lo; z < hi; ++z)
      for (Index y = 0; y < ny; ++y)
        for (Index x = 0; x < nx; ++x)
          at(now, x, y, z) = std::sin(0.2f * x) * std::sin(0.25f * y) * std::sin(0.15f * z);
    next = now;
  }

  void exchange_ghosts() {
    const int below = rank > 0 ? rank - 1 : MPI_PROC_NULL;
    const int above = rank + 1 < ranks ? rank + 1 : MPI_PROC_NULL;
    const int count = static_cast<int>(ghosts * layer);
    MPI_Sendrecv(&at(now, 0, 0, lo), count, MPI_FLOAT, below, 0, &at(now, 0, 0, hi), count,
                 MPI_FLOAT, above, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    MPI_Sendrecv(&at(now, 0, 0, hi - ghosts), count, MPI_FLOAT, above, 1,
                 &at(now, 0, 0, lo - ghosts), count, MPI_FLOAT, below, 1, MPI_COMM_WORLD,
                 MPI_STATUS_IGNORE);
  }

  void step() {
    for (Index z = std::max<Index>(lo, 1); z < std::min(hi, nz - 1); ++z)
      for (Index y = 1; y < ny - 1; ++y)
        for (Index x = 1; x < nx - 1; ++x)
          at(next, x, y, z) =
              at(now, x, y, z) +
              0.1f * (at(now, x - 1, y, z) + at(now, x + 1, y, z) + at(now, x, y - 1, z) +
                      at(now, x, y + 1, z) + at(now, x, y, z - 1) + at(now, x, y, z + 1) -
                      6 * at(now, x, y, z));
    now.swap(next);
    exchange_ghosts();
  }

  /// The surface in the cells of this rank, at its place in the whole box.
  isobrick::Mesh surface(double isovalue) {
    isobrick::Volume volume{.extent = {nx, ny, nz}};
    volume.read = [this](isobrick::Box3 box, void* out) {
      auto* to = static_cast<float*>(out);
      for (Index z = box.lo.z; z < box.hi.z; ++z)
        for (Index y = box.lo.y; y < box.hi.y; ++y) {
          // What lies beyond the ghost layers does not show in the cells of this rank.
          const float* row = &at(now, 0, y, std::clamp(z, lo - ghosts, hi + ghosts - 1));
          to = std::copy(row + box.lo.x, row + box.hi.x, to);
        }
    };
    const isobrick::Box3 own{{0, 0, lo}, {nx, ny, std::min(hi + 1, nz)}};
    return isobrick::extract(volume, {.isovalue = isovalue, .roi = own, .normals = true});
  }
};

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  Simulation simulation;
  simulation.exchange_ghosts();
  for (int step = 1; step <= 20; ++step) {
    simulation.step();
    if (step % 10 != 0) continue;
    const isobrick::Mesh mesh = simulation.surface(0.1);
    mesh.save("heat_" + std::to_string(step) + "_" + std::to_string(simulation.rank) + ".vtp",
              {.force = true});
    unsigned long long own = mesh.triangles.size(), all = 0;
    MPI_Reduce(&own, &all, 1, MPI_UNSIGNED_LONG_LONG, MPI_SUM, 0, MPI_COMM_WORLD);
    if (simulation.rank == 0) std::printf("step %d: %llu triangles\n", step, all);
  }
  MPI_Finalize();
}

#include <charconv>
#include <cstdlib>
#include <cstring>

#include <isobrick/error.h>
#include "io/bytes/module.h"
#include "ranks/ranks.h"

namespace isobrick::inline v0 {
namespace {

int number_in(const char* name) {
  const char* text = std::getenv(name);
  if (text == nullptr) return 0;
  int number = 0;
  std::from_chars(text, text + std::strlen(text), number);
  return number;
}

}  // namespace

int launched_ranks() {
  // Of mpirun of Open MPI, of mpirun of MPICH and its relatives.
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"})
    if (const int ranks = number_in(name); ranks > 0) return ranks;
  // srun sets SLURM_NTASKS for all tasks, PMIX_RANK only for those of MPI.
  if (std::getenv("PMIX_RANK") != nullptr) return number_in("SLURM_NTASKS");
  return 0;
}

std::unique_ptr<Ranks> join_ranks() {
#ifdef ISOBRICK_WITH_MPI
  return load_module<MpiModule>("mpi", "jobs of MPI").join();
#else
  throw Error(
      "this isobrick was built without MPI: give each rank a part (--part), or --mpi off to let "
      "each do all of the work");
#endif
}

}  // namespace isobrick

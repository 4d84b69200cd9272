# Jobs of several processes. The C++ bindings of old are not needed.
set(MPI_CXX_SKIP_MPICXX ON)
find_package(MPI QUIET COMPONENTS CXX)
isobrick_found_option(ISOBRICK_MPI "Share the work among the ranks of mpirun" "${MPI_CXX_FOUND}" MPI
  "ranks of mpirun share no work")

# The CUDA backend is built where there is a CUDA compiler. ISOBRICK_CUDA=OFF leaves it out;
# ON makes a missing compiler an error.
if(NOT CMAKE_CUDA_COMPILER AND NOT DEFINED ENV{CUDACXX})
  find_program(CMAKE_CUDA_COMPILER nvcc PATHS /usr/local/cuda/bin)
endif()
if(CMAKE_CUDA_COMPILER OR DEFINED ENV{CUDACXX})
  set(isobrick_has_nvcc ON)
else()
  set(isobrick_has_nvcc OFF)
endif()
option(ISOBRICK_CUDA "Build the CUDA backend" ${isobrick_has_nvcc})

if(ISOBRICK_CUDA)
  # Turing to Blackwell; the last one also as PTX for what comes after.
  set(CMAKE_CUDA_ARCHITECTURES 75-real 80-real 86-real 89-real 90-real 100-real 120
      CACHE STRING "CUDA architectures")
  enable_language(CUDA)
  find_package(CUDAToolkit REQUIRED)
  # CMake 3.25 does not know that nvcc has C++20.
  if(NOT CMAKE_CUDA20_STANDARD_COMPILE_OPTION)
    set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION -std=c++20)
    set(CMAKE_CUDA20_EXTENSION_COMPILE_OPTION -std=c++20)
    list(APPEND CMAKE_CUDA_COMPILE_FEATURES cuda_std_20)
  endif()
endif()

#pragma once

/// Marks arithmetic that the CPU and the CUDA backend share to the letter.
#ifdef __CUDACC__
#define ISOBRICK_HD __host__ __device__
#else
#define ISOBRICK_HD
#endif

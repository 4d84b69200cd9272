#pragma once

#include <cstdint>

// The structures by which libraries of Python pass arrays on: dmlc.github.io/dlpack, version 0.8.

namespace isobrick::python::dlpack {

inline constexpr std::int32_t kCuda = 2, kManaged = 13;                    ///< of Device::type
inline constexpr std::uint8_t kInt = 0, kUInt = 1, kFloat = 2, kBool = 6;  ///< of DataType::code

struct Device {
  std::int32_t type, id;
};

struct DataType {
  std::uint8_t code, bits;
  std::uint16_t lanes;
};

/// Strides are in elements; null: C order.
struct Tensor {
  void* data;
  Device device;
  std::int32_t ndim;
  DataType dtype;
  std::int64_t* shape;
  std::int64_t* strides;
  std::uint64_t byte_offset;
};

/// In a capsule "dltensor", which is renamed "used_dltensor" by the one who calls the deleter.
struct ManagedTensor {
  Tensor tensor;
  void* owner;
  void (*deleter)(ManagedTensor*);
};

}  // namespace isobrick::python::dlpack

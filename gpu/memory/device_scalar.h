#pragma once

#include <isobrick/scalar.h>

namespace isobrick::gpu {

/// The types that stay at their own width on the device; all are interpolated in float.
constexpr bool is_device_scalar(ScalarType type) {
  return type == ScalarType::u8 || type == ScalarType::i8 || type == ScalarType::u16 ||
         type == ScalarType::i16 || type == ScalarType::f32;
}

/// Calls f(TypeTag<T>{}) for a type of is_device_scalar.
template <class F>
auto visit_device_scalar(ScalarType type, F&& f) {
  switch (type) {
    case ScalarType::u8: return f(TypeTag<std::uint8_t>{});
    case ScalarType::i8: return f(TypeTag<std::int8_t>{});
    case ScalarType::u16: return f(TypeTag<std::uint16_t>{});
    case ScalarType::i16: return f(TypeTag<std::int16_t>{});
    default: return f(TypeTag<float>{});
  }
}

}  // namespace isobrick::gpu

#pragma once

#include <cstdint>

/// Expands MACRO(T) for the eight sample types.
#define ISOBRICK_FOR_SAMPLE_TYPES(MACRO) \
  MACRO(std::uint8_t)                    \
  MACRO(std::int8_t)                     \
  MACRO(std::uint16_t)                   \
  MACRO(std::int16_t)                    \
  MACRO(std::uint32_t)                   \
  MACRO(std::int32_t)                    \
  MACRO(float)                           \
  MACRO(double)

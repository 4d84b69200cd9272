#pragma once

#include <cstdint>

#include <nlohmann/json.hpp>

#include <isobrick/label.h>

// Labels as integers of JSON with all digits, by nlohmann's way of conversions.

namespace isobrick::inline v0 {

template <class Json>
void to_json(Json& json, const Label& label) {
  if (const auto integer = label.as_signed())
    json = *integer;
  else
    json = label.bits();
}

/// Throws as nlohmann's get() does where it is no number.
template <class Json>
void from_json(const Json& json, Label& label) {
  if (json.is_number_unsigned())
    label = json.template get<std::uint64_t>();
  else
    label = json.template get<std::int64_t>();
}

}  // namespace isobrick

#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

namespace isobrick::test {

/// The bytes of the least budget that a refusal names: "--memory 41M".
inline std::uint64_t least_budget_in(const std::string& refusal) {
  const std::string before = "--memory ";
  const std::size_t at = refusal.find(before);
  EXPECT_NE(at, std::string::npos) << refusal;
  if (at == std::string::npos) return 0;
  return std::stoull(refusal.substr(at + before.size())) << 20;
}

}  // namespace isobrick::test

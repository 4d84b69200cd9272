#include <gtest/gtest.h>

#include <bit>
#include <cstdlib>
#include <map>
#include <random>
#include <set>
#include <string>

#include "surface/inner_vertices.h"
#include "tests/surface/patch_surface.h"
#include "tests/surface/subcases.h"

// Topology::trilinear in single cells.

namespace isobrick::testing {
namespace {

const CellPatch& patch_of(const Corners& d) {
  double values[8];
  std::copy(d.begin(), d.end(), values);
  const TopologyTables& tables = topology_tables();
  return tables.patches[cell_topology::patch_of(tables, case_of(d), values)];
}

/// Nothing, or what is wrong.
std::string mismatch(const Corners& d) {
  const CellSurface expected = refined_surface(d), found = surface_of(patch_of(d));
  if (expected == found) return {};
  std::string text = "case " + std::to_string(case_of(d)) + " " + subcase(d, patch_of(d)) +
                     (expected.closed_piece ? " (disputed)" : "") + ":";
  for (const double v : d) text += " " + std::to_string(v);
  text += "\n  expected";
  for (const int v : expected.piece) text += " " + std::to_string(v);
  for (const int v : expected.euler) text += " χ" + std::to_string(v);
  text += "\n  found   ";
  for (const int v : found.piece) text += " " + std::to_string(v);
  for (const int v : found.euler) text += " χ" + std::to_string(v);
  return text;
}

TEST(TopologyCells, EverySubcaseIsThatOfTheInterpolant) {
  std::mt19937 random(5);
  const auto uniform = [&] { return (static_cast<double>(random()) + 0.5) / 4294967296.0; };
  std::map<std::string, int> seen;
  const int each = std::getenv("ISOBRICK_TEST_ALL") ? 2000 : 40;
  for (int i = 0; i < 400'000; ++i) {
    // Every other cell has the signs of a case with an ambiguity within.
    static constexpr int kHard[] = {0x69, 0x96, 0x81, 0x16, 0x29, 0x68, 0x3c, 0xc3,
                                    0x5a, 0x99, 0x1c, 0x94, 0x49, 0x7e, 0xe9, 0x97};
    const unsigned index = i % 2 ? static_cast<unsigned>(kHard[random() % 16]) : random() % 256;
    Corners d;
    for (std::size_t c = 0; c < 8; ++c) {
      const double size = i % 3 == 0 ? 0.5 + uniform() : uniform();
      d[c] = index >> c & 1 ? size : -size;
    }
    int& count = seen[subcase(d, patch_of(d))];
    if (++count > each) continue;
    ASSERT_EQ(mismatch(d), "");
  }
  for (const char* name :
       {"0",       "1",       "2",       "3.1",     "3.2",   "4.1.1",  "4.1.2",  "5",
        "6.1.1",   "6.1.2",   "6.2",     "7.1",     "7.2",   "7.3",    "7.4.1",  "7.4.2",
        "8",       "9",       "10.1.1",  "10.1.2",  "10.2",  "11",     "12.1.1", "12.1.2",
        "12.2",    "13.1",    "13.2",    "13.3",    "13.4",  "13.5.1", "13.5.2", "14",
        "0′",      "1′",      "2′",      "3.1′",    "3.2′",  "4.1.1′", "4.1.2′", "5′",
        "6.1.1′",  "6.1.2′",  "6.2′",    "7.1′",    "7.2′",  "7.3′",   "7.4.1′", "7.4.2′",
        "10.1.1′", "10.1.2′", "12.1.1′", "12.1.2′", "13.1′", "13.2′",  "13.3′"}) {
    EXPECT_TRUE(seen.count(name)) << name;
    seen.erase(name);
  }
  for (const auto& [name, count] : seen) ADD_FAILURE() << "unknown: " << name << " " << count;
}

}  // namespace
}  // namespace isobrick::testing

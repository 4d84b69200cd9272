#include "core/mesh_free_list.h"

#include <gtest/gtest.h>

namespace isobrick::inline v0 {
namespace {

TEST(MeshFreeList, TakesRoomForBothOrNothing) {
  MeshFreeList list(10, 20);
  EXPECT_EQ(list.take(4, 8), (MeshRange{0, 4, 0, 8}));
  EXPECT_EQ(list.take(5, 13), std::nullopt) << "too many triangles";
  EXPECT_EQ(list.take(7, 1), std::nullopt) << "too many vertices";
  EXPECT_FALSE(list.has(7, 1));
  EXPECT_TRUE(list.has(6, 12));
  EXPECT_EQ(list.take(6, 12), (MeshRange{4, 6, 8, 12})) << "a refusal takes nothing";
}

TEST(MeshFreeList, WhatIsTrimmedOrGivenBackIsFree) {
  MeshFreeList list(10, 20);
  const MeshRange large = *list.take(10, 20);
  const MeshRange kept = list.trim(large, 3, 5);
  EXPECT_EQ(kept, (MeshRange{0, 3, 0, 5}));
  EXPECT_EQ(list.take(7, 15), (MeshRange{3, 7, 5, 15}));
  list.give_back(kept);
  EXPECT_EQ(list.take(3, 5), kept);
}

}  // namespace
}  // namespace isobrick

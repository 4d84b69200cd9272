#include "gpu/memory/mapped_pages.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <utility>

namespace isobrick::inline v0::gpu {
namespace {

TEST(MappedPages, AreWholeAlignedAndWritable) {
  for (const std::size_t bytes : {std::size_t{1}, std::size_t{4096}, std::size_t{70'000},
                                  MappedPages::kLargePage, MappedPages::kLargePage * 3 + 5}) {
    MappedPages pages(bytes);
    EXPECT_EQ(pages.bytes(), MappedPages::whole_pages(bytes));
    EXPECT_GE(pages.bytes(), bytes);
    EXPECT_LT(pages.bytes() - bytes, MappedPages::kPage);
    const std::size_t align =
        bytes < MappedPages::kLargePage ? MappedPages::kPage : MappedPages::kLargePage;
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(pages.data()) % align, 0u);
    MappedPages::touch(pages.data(), pages.bytes());
    pages.data()[pages.bytes() - 1] = std::byte{7};
    const MappedPages moved = std::move(pages);
    EXPECT_EQ(moved.data()[moved.bytes() - 1], std::byte{7});
    EXPECT_EQ(moved.data()[0], std::byte{0});
  }
}

TEST(MappedPages, NoneAreNothing) {
  const MappedPages none(0);
  EXPECT_EQ(none.data(), nullptr);
  EXPECT_EQ(none.bytes(), 0u);
}

}  // namespace
}  // namespace isobrick::gpu

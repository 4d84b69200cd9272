#include "index/span_index.h"

#include <algorithm>
#include <bit>

#include <isobrick/error.h>
#include "core/threshold.h"
#include "index/instantiate.h"

namespace isobrick::inline v0 {
namespace {

/// Converts the isovalue to the items' type once and lets the structure report to `sink`.
template <class Sink>
void report(const IndexView& index, double iso, Sink& sink) {
  visit_index(index, [&]<template <class> class View, class T>(const View<T>& view) {
    const Threshold<T> threshold(iso);
    if (!threshold.none) traverse(view, threshold.value, sink);
  });
}

}  // namespace

template <class T>
std::vector<std::byte> build_index(IndexKind kind, std::span<const ValueRange<T>> ranges,
                                   Int3 grid) {
  const IndexHeader header = index_detail::header_for(kind, scalar_type_of<T>, ranges.size(), grid);
  switch (kind) {
    case IndexKind::interval: return IntervalView<T>::build(header, ranges);
    case IndexKind::kdtree: return KdView<T>::build(header, ranges);
    case IndexKind::quadtree: return QuadtreeView<T>::build(header, ranges);
    case IndexKind::octree: return OctreeView<T>::build(header, ranges);
    case IndexKind::linear: break;
  }
  return LinearView<T>::build(header, ranges);
}

void query(const IndexView& index, double iso, std::vector<std::uint32_t>& ids) {
  AppendSink sink(ids);
  report(index, iso, sink);
}

std::uint64_t count(const IndexView& index, double iso) {
  CountSink sink;
  report(index, iso, sink);
  return sink.count();
}

void mark(const IndexView& index, double iso, std::span<std::uint64_t> words) {
  if (words.size() < mask_words(index.items()))
    throw UsageError("a mask of " + std::to_string(words.size()) + " words is too small for " +
                     std::to_string(index.items()) + " items");
  MarkSink sink(words.data());
  report(index, iso, sink);
}

void query_ascending(const IndexView& index, double iso, std::vector<std::uint32_t>& ids) {
  if (index.kind() == IndexKind::linear) return query(index, iso, ids);
  const std::size_t before = ids.size();
  query(index, iso, ids);
  const std::size_t answers = ids.size() - before;
  // Sorting k answers takes about k·log₂ k steps; a mask one for each word of it
  // and one for each answer.
  constexpr std::size_t log = 16;
  const std::size_t words = mask_words(index.items());
  if (answers * log < words) {
    std::sort(ids.begin() + static_cast<std::ptrdiff_t>(before), ids.end());
    return;
  }
  std::vector<std::uint64_t> mask(words);
  for (std::size_t i = before; i < ids.size(); ++i) MarkSink(mask.data()).id(ids[i]);
  std::uint32_t* out = ids.data() + before;
  for (std::size_t w = 0; w < words; ++w)
    for (std::uint64_t word = mask[w]; word; word &= word - 1)
      *out++ =
          static_cast<std::uint32_t>(64 * w) + static_cast<std::uint32_t>(std::countr_zero(word));
  // An index whose bytes name an item twice has fewer.
  ids.resize(static_cast<std::size_t>(out - ids.data()));
}

QuerySteps count_steps(const IndexView& index, double iso) {
  StepsSink sink;
  report(index, iso, sink);
  return sink.steps();
}

#define ISOBRICK_INSTANTIATE(T) \
  template std::vector<std::byte> build_index<T>(IndexKind, std::span<const ValueRange<T>>, Int3);
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick

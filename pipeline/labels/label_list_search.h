#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/store_reader.h>
#include "bricks/stored_index.h"
#include "index/label_lists.h"
#include "pipeline/labels/label_selection.h"

namespace isobrick::inline v0 {

/// Which tiles of a chunk may have a chosen label.
class ListedTiles {
 public:
  /// `known` are the tiles that lists are known of; of others nothing is.
  ListedTiles(Box3 all, Box3 known)
      : known_(known),
        any_(all != known),
        marks_(static_cast<std::size_t>(volume(known.extent()))) {}

  void mark(Int3 tile) {
    marks_[static_cast<std::size_t>(linear_index(tile - known_.lo, known_.extent()))] = true;
    any_ = true;
  }
  bool any() const { return any_; }
  bool may_have(Int3 tile) const {
    return !known_.contains(tile) ||
           marks_[static_cast<std::size_t>(linear_index(tile - known_.lo, known_.extent()))];
  }

 private:
  Box3 known_;
  bool any_;
  std::vector<bool> marks_;
};

/// Finds the tiles that have a chosen label by a store's lists of labels.
class LabelListSearch {
 public:
  /// `labels` must outlive it. Throws as StoredIndex does.
  LabelListSearch(const StoreReader& store, int level, const LabelSelection& labels);

  /// Those of a range chunk. Throws DamageError.
  ListedTiles find(Int3 chunk);

  /// Memory that it takes for a level at most.
  static std::uint64_t bytes(const Lattice& lattice);
  /// Of the index, so far.
  std::uint64_t bytes_read() const { return bytes_read_; }

 private:
  bool meets(const LabelList& list) const;
  std::vector<LabelList> read(const IndexChunk& chunk, std::size_t part, Index items) const;

  const LabelSelection& labels_;
  Lattice lattice_;
  StoredIndex index_;
  std::uint64_t bytes_read_ = 0;
};

}  // namespace isobrick

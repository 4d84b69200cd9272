#pragma once

// The leaves of a tree, of which only the masks are in memory. Only for the sources that see
// OpenVDB anyway.

#include <fmt/format.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <istream>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "io/bytes/file.h"
#include "io/volumes/vdb/vdb_stream.h"

namespace isobrick::inline v0 {

/// What a tree's nodes are, its leaves without their values.
struct VdbNodeCounts {
  std::uint64_t leaves = 0;
  std::uint64_t bytes = 0;  ///< of all nodes in memory
};

/// What the allocator adds to each node.
inline constexpr std::uint64_t kVdbNodeOverhead = 16;

template <class Node>
void count_vdb_node(std::istream& in, bool as_half, VdbNodeCounts& counts) {
  using Mask = typename Node::NodeMaskType;
  counts.bytes += sizeof(Node) + kVdbNodeOverhead;
  if constexpr (Node::LEVEL == 0) {
    ++counts.leaves;
    in.seekg(sizeof(Mask), std::ios_base::cur);
  } else {
    Mask children, values;
    children.load(in);
    values.load(in);
    openvdb::io::readCompressedValues<typename Node::ValueType>(in, nullptr, Node::NUM_VALUES,
                                                                values, as_half);
    for (openvdb::Index i = children.countOn(); i > 0; --i)
      count_vdb_node<typename Node::ChildNodeType>(in, as_half, counts);
  }
}

/// Walks through the nodes of a tree that begins at `in`, and allocates none of them.
/// Afterwards `in` is where it was.
template <class Tree>
VdbNodeCounts count_vdb_nodes(std::istream& in, bool as_half) {
  using Value = typename Tree::ValueType;
  using Count = std::uint32_t;
  constexpr std::streamoff kCoord = 3 * sizeof(std::int32_t);
  constexpr std::streamoff kTile = kCoord + std::streamoff{sizeof(Value)} + sizeof(bool);
  constexpr std::uint64_t kTableEntry = 96;  // a node of a map
  const auto begin = in.tellg();
  Count buffers = 0, tiles = 0, children = 0;
  in.read(reinterpret_cast<char*>(&buffers), sizeof(Count));
  if (buffers != 1) throw std::runtime_error("its tree has several buffers");
  in.seekg(sizeof(Value), std::ios_base::cur);  // the background
  in.read(reinterpret_cast<char*>(&tiles), sizeof(Count));
  in.read(reinterpret_cast<char*>(&children), sizeof(Count));
  in.seekg(kTile * tiles, std::ios_base::cur);
  VdbNodeCounts counts;
  counts.bytes = kTableEntry * (std::uint64_t{tiles} + children);
  for (Count i = 0; i < children; ++i) {
    in.seekg(kCoord, std::ios_base::cur);
    count_vdb_node<typename Tree::RootNodeType::ChildNodeType>(in, as_half, counts);
  }
  in.seekg(begin);
  return counts;
}

/// Where the values of a tree's leaves are in its file. They are read when they are
/// needed, and never kept.
template <class Tree>
class VdbLeaves {
 public:
  using Value = typename Tree::ValueType;
  using Leaf = typename Tree::LeafNodeType;

  /// `in` is where the values begin, as it is when the tree's topology has been read from
  /// it. Numbers the leaves, which is kept in them. `as_half`: values have 16 bits.
  VdbLeaves(const std::string& path, std::istream& in, Tree& tree, bool as_half);

  /// Bytes that so many leaves take here.
  static std::size_t memory(std::uint64_t leaves) { return leaves * sizeof(std::uint64_t); }

  /// Reads leaves of one tree; each thread needs one of its own.
  class Reader {
   public:
    explicit Reader(const VdbLeaves& leaves);
    /// Calls f(leaf, values) for each of some leaves: values(i) is that of voxel i in
    /// the order of OpenVDB's leaves. Throws what OpenVDB throws for damaged values.
    template <class F>
    void read(std::span<const Leaf* const> leaves, const F& f);

   private:
    using Mask = typename Leaf::NodeMaskType;
    void read_leaf(std::span<char> bytes, const Mask& active, Value* values);
    void restore(const char* code, const Mask& active, const Value* kept, Value* values) const;

    const VdbLeaves& leaves_;
    std::vector<char> bytes_;
    VdbMemoryBuffer buffer_;
    openvdb::io::StreamMetadata::Ptr how_;  // the stream refers to this very pointer
    std::istream in_;
  };

 private:
  /// More than any leaf has, however it was written.
  static constexpr std::uint64_t kMaxBytes = 1 << 16;

  File file_;
  bool as_half_;
  openvdb::io::StreamMetadata how_;   ///< version, compression and background
  std::vector<std::uint64_t> begin_;  ///< of each leaf; one more at the end
};

template <class Tree>
VdbLeaves<Tree>::VdbLeaves(const std::string& path, std::istream& in, Tree& tree, bool as_half)
    : file_(open_input(path)), as_half_(as_half), how_(*openvdb::io::getStreamMetadataPtr(in)) {
  how_.setBackgroundPtr(&tree.background());
  const std::uint64_t leaves = tree.leafCount();
  if (leaves > std::numeric_limits<openvdb::Index32>::max())
    throw std::runtime_error(fmt::format("it has {} leaves", leaves));
  begin_.reserve(leaves + 1);
  begin_.push_back(static_cast<std::uint64_t>(in.tellg()));
  for (auto leaf = tree.beginLeaf(); leaf; ++leaf) {
    leaf->setTransientData(static_cast<openvdb::Index32>(begin_.size() - 1));
    in.seekg(sizeof(typename Leaf::NodeMaskType), std::ios_base::cur);
    openvdb::io::readCompressedValues<Value>(in, nullptr, Leaf::SIZE, leaf->valueMask(), as_half);
    const auto end = static_cast<std::uint64_t>(in.tellg());
    if (end <= begin_.back() || end - begin_.back() > kMaxBytes)
      throw std::runtime_error(fmt::format("no leaf takes the bytes {} to {}", begin_.back(), end));
    begin_.push_back(end);
  }
}

template <class Tree>
VdbLeaves<Tree>::Reader::Reader(const VdbLeaves& leaves)
    : leaves_(leaves),
      how_(std::make_shared<openvdb::io::StreamMetadata>(leaves.how_)),
      in_(&buffer_) {
  in_.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
  openvdb::io::setStreamMetadataPtr(in_, how_, true);
}

/// Where only active values are kept, OpenVDB reads them, but the others are put between them by
/// restore(): OpenVDB tests for each voxel whether it is active, a branch that is mispredicted half
/// the time.
template <class Tree>
void VdbLeaves<Tree>::Reader::read_leaf(std::span<char> bytes, const Mask& active, Value* values) {
  buffer_.assign(bytes);
  Mask again;
  again.load(in_);
  const bool only_active = (how_->compression() & openvdb::io::COMPRESS_ACTIVE_MASK) != 0 &&
                           bytes.size() > sizeof(Mask) &&
                           bytes[sizeof(Mask)] != openvdb::io::NO_MASK_AND_ALL_VALS;
  const openvdb::Index count = only_active ? active.countOn() : Leaf::SIZE;
  if (count == Leaf::SIZE)
    return openvdb::io::readCompressedValues(in_, values, Leaf::SIZE, active, leaves_.as_half_);
  Value kept[Leaf::SIZE];
  openvdb::io::readCompressedValues(in_, kept, count, active, leaves_.as_half_);
  restore(bytes.data() + sizeof(Mask), active, kept, values);
}

/// `code` describes the two inactive values, and which voxel has which. It has been read once, so
/// it is whole.
template <class Tree>
void VdbLeaves<Tree>::Reader::restore(const char* code, const Mask& active, const Value* kept,
                                      Value* values) const {
  using namespace openvdb::io;
  const int kind = *code++;
  const Value background = *static_cast<const Value*>(how_->backgroundPtr());
  Value inactive[2] = {
      kind == NO_MASK_OR_INACTIVE_VALS ? background : openvdb::math::negative(background),
      background};
  const auto take = [&code](auto& what) {
    std::memcpy(&what, code, sizeof what);
    code += sizeof what;
  };
  const bool two = kind == MASK_AND_TWO_INACTIVE_VALS;
  if (kind == NO_MASK_AND_ONE_INACTIVE_VAL || kind == MASK_AND_ONE_INACTIVE_VAL || two)
    take(inactive[0]);
  if (two) take(inactive[1]);
  std::uint64_t second[Leaf::SIZE / 64] = {};  // bit i: inactive[1], if voxel i is inactive
  static_assert(sizeof second == sizeof(Mask));
  if (kind == MASK_AND_NO_INACTIVE_VALS || kind == MASK_AND_ONE_INACTIVE_VAL || two) take(second);
  for (openvdb::Index word = 0; word < Leaf::SIZE / 64; ++word, values += 64) {
    for (int i = 0; i < 64; ++i) values[i] = inactive[second[word] >> i & 1];
    for (auto on = active.template getWord<std::uint64_t>(word); on != 0; on &= on - 1)
      values[std::countr_zero(on)] = *kept++;
  }
}

template <class Tree>
template <class F>
void VdbLeaves<Tree>::Reader::read(std::span<const Leaf* const> leaves, const F& f) {
  Value values[Leaf::SIZE];
  while (!leaves.empty()) {
    // Those that follow each other in the file are fetched together.
    const std::size_t first = leaves.front()->transientData();
    std::size_t count = 1;
    while (count < leaves.size() && leaves[count]->transientData() == first + count) ++count;
    const std::uint64_t* begin = leaves_.begin_.data() + first;
    bytes_.resize(begin[count] - begin[0]);
    leaves_.file_.read_at(begin[0], std::as_writable_bytes(std::span(bytes_)));
    for (std::size_t i = 0; i < count; ++i) {
      read_leaf(std::span(bytes_).subspan(begin[i] - begin[0], begin[i + 1] - begin[i]),
                leaves[i]->valueMask(), values);
      f(*leaves[i], [&](openvdb::Index at) { return values[at]; });
    }
    leaves = leaves.subspan(count);
  }
}

/// The same of a tree that is in memory as a whole: of bool or a mask.
template <class Tree>
class VdbLoadedLeaves {
 public:
  using Leaf = typename Tree::LeafNodeType;

  class Reader {
   public:
    explicit Reader(const VdbLoadedLeaves&) {}
    template <class F>
    void read(std::span<const Leaf* const> leaves, const F& f) {
      for (const Leaf* leaf : leaves)
        f(*leaf, [leaf](openvdb::Index at) { return leaf->getValue(at); });
    }
  };
};

}  // namespace isobrick

#include "pipeline/labels/label_spool.h"

#include <algorithm>
#include <cstring>

#include "core/morton.h"

namespace isobrick::inline v0 {
namespace {

/// Before the items of a piece.
struct PieceHeader {
  std::uint64_t previous = LabelSpool::kNoPiece;
  std::uint64_t tile = 0;  ///< its Morton code
  std::int64_t label = 0;
  std::uint32_t vertices = 0, foreign = 0, quads = 0;
  std::uint32_t unused = 0;

  std::size_t item_bytes() const {
    return vertices * sizeof(LabelVertex) + foreign * sizeof(ForeignVertex) +
           quads * sizeof(LabelQuad);
  }
};

template <class T>
std::byte* put(std::byte* to, std::span<const T> items) {
  if (!items.empty()) std::memcpy(to, items.data(), items.size_bytes());
  return to + items.size_bytes();
}

template <class T>
const std::byte* take(const std::byte* from, std::size_t count, std::vector<T>& items) {
  items.resize(count);
  if (count > 0) std::memcpy(items.data(), from, count * sizeof(T));
  return from + count * sizeof(T);
}

}  // namespace

std::uint64_t LabelSpool::max_packed_bytes() {
  constexpr std::uint64_t cells = std::uint64_t{kTileEdge + 1} * (kTileEdge + 1) * (kTileEdge + 1);
  // As many sheets as corners and a header for each sheet; an edge has two quads.
  return cells * (8 * (sizeof(PieceHeader) + sizeof(LabelVertex)) + 6 * sizeof(LabelQuad));
}

std::vector<std::byte> LabelSpool::pack(std::span<const LabelPiece> pieces) {
  std::size_t bytes = 0;
  for (const LabelPiece& piece : pieces)
    bytes += sizeof(PieceHeader) + piece.vertices.size_bytes() + piece.foreign.size_bytes() +
             piece.quads.size_bytes();
  std::vector<std::byte> packed(bytes);
  std::byte* to = packed.data();
  for (const LabelPiece& piece : pieces) {
    const PieceHeader header{.label = piece.label,
                             .vertices = static_cast<std::uint32_t>(piece.vertices.size()),
                             .foreign = static_cast<std::uint32_t>(piece.foreign.size()),
                             .quads = static_cast<std::uint32_t>(piece.quads.size())};
    to = put(to, std::span(&header, 1));
    to = put(to, piece.vertices);
    to = put(to, piece.foreign);
    to = put(to, piece.quads);
  }
  return packed;
}

void LabelSpool::append(Int3 tile, std::span<const std::byte> packed) {
  while (!packed.empty()) {
    PieceHeader header;
    std::memcpy(&header, packed.data(), sizeof header);
    const auto items = packed.subspan(sizeof header, header.item_bytes());
    packed = packed.subspan(sizeof header + items.size());

    const auto [chain, is_new] = chain_of_.insert(label_key(header.label));
    if (is_new)
      chain = {.label = header.label, .last = kNoPiece, .first_tile = tile, .last_tile = tile};
    header.previous = chain.last;
    header.tile = morton_encode(tile);
    chain.last = writer_.size();
    chain.vertices += header.vertices;
    chain.quads += header.quads;
    chain.first_tile = min(chain.first_tile, tile);
    chain.last_tile = max(chain.last_tile, tile);
    writer_.append(std::as_bytes(std::span(&header, 1)));
    writer_.append(items);
  }
}

std::vector<LabelChain> LabelSpool::finish() {
  writer_.flush();
  file_ = writer_.share();
  std::vector<LabelChain> chains;
  chains.reserve(chain_of_.size());
  chain_of_.for_each([&](std::uint64_t, const LabelChain& chain) { chains.push_back(chain); });
  std::sort(chains.begin(), chains.end(),
            [](const LabelChain& a, const LabelChain& b) { return a.label < b.label; });
  return chains;
}

void LabelSpool::read(std::uint64_t place, SpooledPiece& piece) const {
  PieceHeader header;
  file_.read_at(place, std::as_writable_bytes(std::span(&header, 1)));
  std::vector<std::byte> items(header.item_bytes());
  file_.read_at(place + sizeof header, items);
  piece.previous = header.previous;
  piece.tile = morton_decode(header.tile);
  const std::byte* from = take(items.data(), header.vertices, piece.vertices);
  from = take(from, header.foreign, piece.foreign);
  take(from, header.quads, piece.quads);
}

}  // namespace isobrick

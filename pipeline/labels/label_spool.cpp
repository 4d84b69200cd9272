#include "pipeline/labels/label_spool.h"

#include <algorithm>
#include <cstring>

#include "core/morton.h"
#include "pipeline/labels/label_record.h"
#include "surface/labels/label_value.h"

namespace isobrick::inline v0 {
namespace {

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
  return cells * (8 * (sizeof(LabelRecord) + sizeof(LabelVertex)) + 6 * sizeof(LabelQuad));
}

std::vector<std::byte> LabelSpool::pack(Int3 tile, std::span<const LabelPiece> pieces) {
  std::size_t bytes = 0;
  for (const LabelPiece& piece : pieces)
    bytes += sizeof(LabelRecord) + piece.vertices.size_bytes() + piece.foreign.size_bytes() +
             piece.quads.size_bytes();
  std::vector<std::byte> packed(bytes);
  std::byte* to = packed.data();
  for (const LabelPiece& piece : pieces) {
    const LabelRecord record{.tile = morton_encode(tile),
                             .label = piece.label.bits(),
                             .vertices = static_cast<std::uint32_t>(piece.vertices.size()),
                             .foreign = static_cast<std::uint32_t>(piece.foreign.size()),
                             .quads = static_cast<std::uint32_t>(piece.quads.size())};
    to = put(to, std::span(&record, 1));
    to = put(to, piece.vertices);
    to = put(to, piece.foreign);
    to = put(to, piece.quads);
  }
  return packed;
}

void LabelSpool::append(std::span<const std::byte> packed) {
  while (!packed.empty()) {
    LabelRecord record;
    std::memcpy(&record, packed.data(), sizeof record);
    const auto bytes = packed.first(sizeof record + record.item_bytes());
    packed = packed.subspan(bytes.size());

    const Int3 tile = morton_decode(record.tile);
    const Label label = label_of_bits(record.label, type_);
    const auto [chain, is_new] = chain_of_.insert(label_key(label));
    if (is_new) chain = {.label = label, .last = kNoPiece, .first_tile = tile, .last_tile = tile};
    const std::uint64_t previous = chain.last;
    chain.last = writer_.size();
    chain.vertices += record.vertices;
    chain.quads += record.quads;
    chain.first_tile = min(chain.first_tile, tile);
    chain.last_tile = max(chain.last_tile, tile);
    writer_.append(std::as_bytes(std::span(&previous, 1)));
    writer_.append(bytes);
  }
}

std::vector<LabelChain> LabelSpool::finish() {
  writer_.flush();
  file_ = writer_.share();
  std::vector<LabelChain> chains;
  chains.reserve(chain_of_.size());
  chain_of_.for_each([&](const LabelKey&, const LabelChain& chain) { chains.push_back(chain); });
  std::sort(chains.begin(), chains.end(),
            [](const LabelChain& a, const LabelChain& b) { return a.label < b.label; });
  return chains;
}

void LabelSpool::read(std::uint64_t place, SpooledPiece& piece) const {
  struct {
    std::uint64_t previous = 0;
    LabelRecord record;
  } head;
  file_.read_at(place, std::as_writable_bytes(std::span(&head, 1)));
  const LabelRecord& record = head.record;
  std::vector<std::byte> items(record.item_bytes());
  file_.read_at(place + sizeof head, items);
  piece.previous = head.previous;
  piece.tile = morton_decode(record.tile);
  const std::byte* from = take(items.data(), record.vertices, piece.vertices);
  from = take(from, record.foreign, piece.foreign);
  take(from, record.quads, piece.quads);
}

}  // namespace isobrick

#include "packed/packed_layout.h"

#include <cstring>

#include <isobrick/error.h>

namespace isobrick::inline v0::packed {
namespace {

std::uint32_t end_at(const std::byte* ends, std::size_t number) {
  std::uint32_t end;
  std::memcpy(&end, ends + number * sizeof end, sizeof end);
  return end;
}

}  // namespace

BrickLayout::BrickLayout(ScalarType type, Int3 extent, std::span<const std::byte> packed)
    : ends_(packed.data() + sizeof(BrickHeader)) {
  const std::size_t table = table_bytes(extent), sample_bytes = size_of(type);
  BrickHeader header;
  if (packed.size() < sizeof header) throw DamageError("too short for a packed brick");
  std::memcpy(&header, packed.data(), sizeof header);
  if (header.version != kVersion)
    throw DamageError("packed by version " + std::to_string(header.version) +
                      ", this program knows version " + std::to_string(kVersion));
  const std::size_t most = max_packed_bytes(extent, sample_bytes);
  if (packed.size() > most) throw DamageError("longer than plain samples");
  if (header.code_bytes == 0 && header.palette == 0) {
    is_plain_ = true;
    blocks_ = packed.subspan(sizeof header);
    if (packed.size() != most)
      throw DamageError("holds " + std::to_string(packed.size()) + " bytes, must hold " +
                        std::to_string(most));
    return;
  }
  if (packed.size() < table) throw DamageError("too short for a packed brick");
  const bool right_palette =
      header.palette <= kMaxPalette && (header.palette == 0 || sample_bytes > 1);
  if (!right_palette || header.code_bytes != (header.palette > 0 ? 1 : sample_bytes))
    throw DamageError("its samples are packed as those of another type");
  entries_ = header.palette;
  if (packed.size() - table < entries_ * sample_bytes)
    throw DamageError("too short for its palette");
  palette_ = packed.subspan(table, entries_ * sample_bytes);
  blocks_ = packed.subspan(table + palette_.size());
  const auto count = static_cast<std::size_t>(volume(blocks_of(extent)));
  std::uint32_t before = 0;
  for (std::size_t number = 0; number < count; ++number) {
    const std::uint32_t end = end_at(ends_, number);
    if (end < before || end > blocks_.size() || end - before > max_block_bytes(header.code_bytes))
      throw DamageError(damaged_block(number));
    before = end;
  }
  if (before != blocks_.size())
    throw DamageError("packed to " + std::to_string(blocks_.size()) + " bytes, must be " +
                      std::to_string(before));
}

std::span<const std::uint8_t> BrickLayout::block(std::size_t number) const {
  const std::uint32_t begin = number == 0 ? 0 : end_at(ends_, number - 1);
  const auto* const bytes = reinterpret_cast<const std::uint8_t*>(blocks_.data());
  return {bytes + begin, bytes + end_at(ends_, number)};
}

std::string damaged_block(std::size_t number) {
  return "its packed block " + std::to_string(number) + " is damaged";
}

}  // namespace isobrick::inline v0::packed

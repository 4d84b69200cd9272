#include "pipeline/convert/brick_output.h"

#include <cstring>
#include <utility>

#include <isobrick/pod_buffer.h>
#include "bricks/zarr/codec.h"
#include "core/copy_box.h"

namespace isobrick::inline v0 {
namespace {

double value_of(ScalarType type, std::uint64_t bits) {
  return visit_sample(type, [&](auto tag) {
    typename decltype(tag)::type value;
    std::memcpy(&value, &bits, sizeof value);
    return static_cast<double>(value);
  });
}

}  // namespace

BrickOutput::BrickOutput(StoreWriter& store, const StoreLayout& layout, int level,
                         ConvertJournal* journal, ValueCounts* histogram, Progress& progress)
    : store_(store),
      layout_(layout),
      level_(level),
      lattice_(layout.levels[static_cast<std::size_t>(level)].lattice),
      journal_(journal),
      histogram_(histogram),
      progress_(progress) {}

PackedBrick BrickOutput::pack(Int3 brick, Box3 box, const std::byte* samples, bool kept) const {
  PackedBrick packed{.brick = brick, .kept = kept};
  if (kept && journal_ == nullptr) return packed;
  const Box3 full = lattice_.full_brick_box(brick);
  if (box == full) {
    if (histogram_ != nullptr) histogram_->add(samples, full, full);
    encode(packed, {samples, lattice_.brick_bytes()});
    return packed;
  }
  thread_local PodBuffer<std::byte> whole;
  whole.resize(lattice_.brick_bytes());
  copy_box({samples, box}, {whole.data(), full}, lattice_.brick_box(brick),
           lattice_.sample_bytes());
  if (histogram_ != nullptr) histogram_->add(whole.data(), full, lattice_.brick_box(brick));
  pad_brick(lattice_, brick, layout_.fill_value, whole.data());
  encode(packed, whole.span());
  return packed;
}

void BrickOutput::encode(PackedBrick& packed, std::span<const std::byte> samples) const {
  if (journal_ != nullptr) packed.crc = crc32c(samples);
  if (!packed.kept)
    packed.encoded = encode_brick(lattice_, samples, layout_.fill_value, layout_.codecs());
}

PackedBrick BrickOutput::pack_constant(Int3 brick, std::uint64_t bits, bool kept) {
  PackedBrick packed{.brick = brick, .kept = kept};
  if (histogram_ != nullptr)
    histogram_->add(value_of(lattice_.type, bits),
                    static_cast<std::uint64_t>(volume(lattice_.brick)));
  std::shared_ptr<const Constant> constant;
  {
    const std::lock_guard lock(mutex_);
    constant = constant_;
  }
  if (!constant || constant->bits != bits) {
    PodBuffer<std::byte> samples;
    samples.resize(lattice_.brick_bytes());
    const Box3 full = lattice_.full_brick_box(brick);
    set_box(lattice_.type, bits, {samples.data(), full}, full);
    PackedBrick made;
    encode(made, samples.span());
    constant = std::make_shared<const Constant>(Constant{bits, made.crc, std::move(made.encoded)});
    const std::lock_guard lock(mutex_);
    constant_ = constant;
  }
  packed.crc = constant->crc;
  if (!kept) packed.encoded = constant->encoded;
  return packed;
}

void BrickOutput::deliver(const PackedBrick& packed) {
  ++counts_.bricks;
  if (journal_ != nullptr) journal_->add(packed.brick, packed.crc);
  if (packed.kept)
    ++counts_.kept;
  else if (packed.encoded)
    store_.put(level_, packed.brick, *packed.encoded);
  else
    ++counts_.absent;
  const auto samples =
      static_cast<std::uint64_t>(volume(lattice_.brick_box(packed.brick).extent()));
  progress_.advance(level_ == 0 ? samples * lattice_.sample_bytes() : 0);
}

void BrickOutput::skip(std::uint64_t bricks) {
  counts_.bricks += bricks;
  counts_.absent += bricks;
}

}  // namespace isobrick

#include "io/volumes/scaled_source.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace isobrick::inline v0 {
namespace {

class ScaledSource final : public VolumeSource {
 public:
  ScaledSource(std::unique_ptr<VolumeSource> stored, ValueScale scale)
      : stored_(std::move(stored)), scale_(scale), info_(stored_->info()) {
    info_.type = scaled_type(info_.type);
  }

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return stored_->random_access(); }
  bool parallel() const override { return stored_->parallel(); }
  std::size_t memory() const override { return stored_->memory(); }
  std::vector<std::string> notes() const override { return stored_->notes(); }
  void will_need(Box3 box) override { stored_->will_need(box); }

  void read(Box3 box, std::byte* out) override {
    const ScalarType type = stored_->info().type;
    const auto count = static_cast<std::size_t>(volume(box.extent()));
    stored_->read(box, out + count * (size_of(info_.type) - size_of(type)));
    scale_in_place(type, info_.type, count, scale_, out);
  }

 private:
  std::unique_ptr<VolumeSource> stored_;
  ValueScale scale_;
  VolumeInfo info_;
};

}  // namespace

void scale_in_place(ScalarType stored, ScalarType scaled, std::size_t count, ValueScale scale,
                    std::byte* out) {
  visit_sample(stored, [&](auto stored_tag) {
    visit_scalar(scaled, [&](auto scaled_tag) {
      using From = typename decltype(stored_tag)::type;
      using To = typename decltype(scaled_tag)::type;
      if constexpr (sizeof(To) >= sizeof(From)) {
        // The stored sample that is read next never lies before what is written.
        const std::byte* from = out + count * (sizeof(To) - sizeof(From));
        for (std::size_t i = 0; i < count; ++i) {
          From v;
          std::memcpy(&v, from + i * sizeof(From), sizeof(From));
          const To value = static_cast<To>(static_cast<double>(v) * scale.slope + scale.intercept);
          std::memcpy(out + i * sizeof(To), &value, sizeof(To));
        }
      }
    });
  });
}

std::optional<ScalarType> integer_scaled_type(ScalarType stored, double lo, double hi,
                                              std::span<const ValueScale> scales) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const ValueScale& scale : scales) {
    if (scale.slope != std::trunc(scale.slope) || scale.intercept != std::trunc(scale.intercept))
      return std::nullopt;
    for (const double end : {lo, hi}) {
      least = std::min(least, end * scale.slope + scale.intercept);
      most = std::max(most, end * scale.slope + scale.intercept);
    }
  }
  for (const ScalarType type : {stored, ScalarType::u8, ScalarType::i8, ScalarType::u16,
                                ScalarType::i16, ScalarType::u32, ScalarType::i32}) {
    const bool fits = visit_scalar(type, [&](auto tag) {
      using Limits = std::numeric_limits<typename decltype(tag)::type>;
      return Limits::is_integer && least >= static_cast<double>(Limits::min()) &&
             most <= static_cast<double>(Limits::max());
    });
    if (fits && size_of(type) >= size_of(stored)) return type;
  }
  return std::nullopt;
}

std::unique_ptr<VolumeSource> scale_source(std::unique_ptr<VolumeSource> stored, ValueScale scale) {
  if (scale.identity()) return stored;
  return std::make_unique<ScaledSource>(std::move(stored), scale);
}

}  // namespace isobrick

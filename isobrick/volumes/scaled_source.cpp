#include "isobrick/volumes/scaled_source.h"

#include <cstring>
#include <type_traits>
#include <utility>

namespace isobrick {
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
  void will_need(Box3 box) override { stored_->will_need(box); }

  void read(Box3 box, std::byte* out) override {
    const ScalarType type = stored_->info().type;
    const auto count = static_cast<std::size_t>(volume(box.extent()));
    stored_->read(box, out + count * (size_of(info_.type) - size_of(type)));
    scale_in_place(type, count, scale_, out);
  }

 private:
  std::unique_ptr<VolumeSource> stored_;
  ValueScale scale_;
  VolumeInfo info_;
};

}  // namespace

void scale_in_place(ScalarType stored, std::size_t count, ValueScale scale, std::byte* out) {
  visit_scalar(stored, [&](auto tag) {
    using From = typename decltype(tag)::type;
    using To = std::conditional_t<std::is_same_v<From, double>, double, float>;
    static_assert(sizeof(To) >= sizeof(From));
    // The stored sample that is read next never lies before what is written.
    const std::byte* from = out + count * (sizeof(To) - sizeof(From));
    for (std::size_t i = 0; i < count; ++i) {
      From v;
      std::memcpy(&v, from + i * sizeof(From), sizeof(From));
      const To scaled = static_cast<To>(static_cast<double>(v) * scale.slope + scale.intercept);
      std::memcpy(out + i * sizeof(To), &scaled, sizeof(To));
    }
  });
}

std::unique_ptr<VolumeSource> scale_source(std::unique_ptr<VolumeSource> stored, ValueScale scale) {
  if (scale.identity()) return stored;
  return std::make_unique<ScaledSource>(std::move(stored), scale);
}

}  // namespace isobrick

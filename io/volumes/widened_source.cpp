#include "io/volumes/widened_source.h"

#include <fmt/format.h>

#include <cassert>
#include <utility>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

class WidenedSource final : public VolumeSource {
 public:
  WidenedSource(std::unique_ptr<VolumeSource> stored, WideType type)
      : stored_(std::move(stored)), type_(type) {
    assert(stored_->info().type == widened(type) &&
           size_of(type) == size_of(stored_->info().type) && "samples are widened in place");
  }

  const VolumeInfo& info() const override { return stored_->info(); }
  bool random_access() const override { return stored_->random_access(); }
  bool parallel() const override { return stored_->parallel(); }
  std::size_t memory() const override { return stored_->memory(); }
  std::vector<std::string> notes() const override { return stored_->notes(); }
  void will_need(Box3 box) override { stored_->will_need(box); }

  void read(Box3 box, std::byte* out) override {
    if (box.empty()) return;
    stored_->read(box, out);
    const auto count = static_cast<std::size_t>(box.extent().x);
    for (Index z = box.lo.z; z < box.hi.z; ++z)
      for (Index y = box.lo.y; y < box.hi.y; ++y, out += count * size_of(type_))
        widen_row(y, z, count, out);
  }

 private:
  void widen_row(Index y, Index z, std::size_t count, std::byte* row) const {
    try {
      widen(type_, row, row, count);
    } catch (const Error& error) {
      throw Error(fmt::format("'{}': {}; it is among the samples at y = {}, z = {}", info().name,
                              error.what(), y, z));
    }
  }

  std::unique_ptr<VolumeSource> stored_;
  WideType type_;
};

}  // namespace

std::unique_ptr<VolumeSource> widen_source(std::unique_ptr<VolumeSource> stored,
                                           std::optional<WideType> type) {
  if (!type) return stored;
  return std::make_unique<WidenedSource>(std::move(stored), *type);
}

}  // namespace isobrick

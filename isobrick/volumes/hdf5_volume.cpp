#include "isobrick/volumes/hdf5_volume.h"

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "isobrick/core/error.h"
#include "isobrick/volumes/hdf5_dataset.h"

namespace isobrick {
namespace {

class Hdf5Source final : public VolumeSource {
 public:
  Hdf5Source(VolumeInfo info, std::unique_ptr<Hdf5Dataset> dataset, const ArrayView& view,
             std::vector<Index> fixed)
      : info_(std::move(info)),
        dataset_(std::move(dataset)),
        view_(view),
        fixed_(std::move(fixed)) {}

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  bool parallel() const override { return false; }
  std::size_t memory() const override { return dataset_->memory(); }

  void read(Box3 box, std::byte* out) override {
    if (box.empty()) return;
    std::vector<Index> start = fixed_, count(fixed_.size(), 1);
    for (int axis = 0; axis < 3; ++axis) {
      const std::size_t at = view_.kept[static_cast<std::size_t>(axis)];
      start[at] = box.lo[axis];
      count[at] = box.extent()[axis];
    }
    dataset_->read(start, count, out);
  }

 private:
  VolumeInfo info_;
  std::unique_ptr<Hdf5Dataset> dataset_;
  ArrayView view_;
  std::vector<Index> fixed_;  ///< where on each axis; those of space are filled in
};

}  // namespace

std::unique_ptr<VolumeSource> open_hdf5(const std::string& file, const std::string& dataset,
                                        const VolumeRequest& said) {
  refuse_raw_description(file, "an HDF5 file", said);
  auto opened = std::make_unique<Hdf5Dataset>(file, dataset, said.threads);
  std::vector<ArrayAxis> axes = opened->axes();
  if (!opened->labelled() && !guess_roles(axes, said.selection))
    throw UsageError(
        fmt::format("'{}': a dataset of {} dimensions, without DIMENSION_LABELS that "
                    "say which 3 are space: {}",
                    file, axes.size(), kRolesHint));
  const ArrayView view = select_volume(file, axes, said.selection);
  std::vector<Index> fixed(axes.size(), 0);
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (axes[i].size == 1 || axes[i].role == AxisRole::space) continue;
    fixed[i] =
        (axes[i].role == AxisRole::time ? said.selection.time : said.selection.channel).value_or(0);
  }
  Transform transform;
  if (opened->element_size().x > 0) {
    transform.spacing = opened->element_size();
    transform.unit = "micrometer";
  }
  VolumeInfo info = describe_volume(file, view.extent, opened->type(), transform, said);
  return std::make_unique<Hdf5Source>(std::move(info), std::move(opened), view, std::move(fixed));
}

}  // namespace isobrick

#include "io/volumes/hdf5/hdf5_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/pod_buffer.h>
#include "io/volumes/hdf5/hdf5_dataset.h"

namespace isobrick::inline v0 {
namespace {

/// Bytes of samples that are read in the file's order before they are turned, unless one layer has
/// more.
constexpr std::size_t kTurnedBytes = std::size_t{8} << 20;

class Hdf5Source final : public VolumeSource {
 public:
  Hdf5Source(VolumeInfo info, std::unique_ptr<Hdf5Dataset> dataset, const ArrayView& view,
             std::vector<Index> fixed)
      : info_(std::move(info)),
        dataset_(std::move(dataset)),
        view_(view),
        fixed_(std::move(fixed)),
        in_order_(std::is_sorted(view.kept.begin(), view.kept.end())) {}

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  bool parallel() const override { return false; }
  std::size_t memory() const override {
    return dataset_->memory() + (in_order_ ? 0 : turned_bytes(info_.extent));
  }

  void read(Box3 box, std::byte* out) override {
    if (box.empty()) return;
    if (in_order_) return read_in_order(box, out);
    // In pieces along the axis that is slowest in the file, so that each chunk is met once.
    const int slow = slowest();
    const Index layers = std::max<Index>(
        1, static_cast<Index>(kTurnedBytes) / std::max<Index>(1, layer_bytes(box.extent())));
    for (Index at = box.lo[slow]; at < box.hi[slow]; at += layers) {
      Box3 piece = box;
      piece.lo[slow] = at;
      piece.hi[slow] = std::min(at + layers, box.hi[slow]);
      turned_.resize(bytes(piece.extent()));
      read_in_order(piece, turned_.data());
      turn(piece, box, out);
    }
  }

 private:
  int slowest() const {
    return static_cast<int>(std::max_element(view_.kept.begin(), view_.kept.end()) -
                            view_.kept.begin());
  }
  std::size_t bytes(Int3 extent) const {
    return static_cast<std::size_t>(volume(extent)) * size_of(info_.type);
  }
  Index layer_bytes(Int3 extent) const {
    extent[slowest()] = 1;
    return static_cast<Index>(bytes(extent));
  }
  std::size_t turned_bytes(Int3 extent) const {
    return std::max(kTurnedBytes, static_cast<std::size_t>(layer_bytes(extent)));
  }

  /// The samples of a box in the order in which the file has its axes.
  void read_in_order(Box3 box, std::byte* out) {
    std::vector<Index> start = fixed_, count(fixed_.size(), 1);
    for (int axis = 0; axis < 3; ++axis) {
      const std::size_t at = view_.kept[static_cast<std::size_t>(axis)];
      start[at] = box.lo[axis];
      count[at] = box.extent()[axis];
    }
    dataset_->read(start, count, out);
  }

  /// Copies what read_in_order() made of `piece` to its places in `box`.
  void turn(Box3 piece, Box3 box, std::byte* out) const {
    Int3 step;  // from one sample to the next in the file's order, along x, y, z
    Index samples = 1;
    for (std::size_t at = 0; at < fixed_.size(); ++at)
      for (int axis = 0; axis < 3; ++axis)
        if (view_.kept[static_cast<std::size_t>(axis)] == at) {
          step[axis] = samples;
          samples *= piece.extent()[axis];
        }
    visit_sample(info_.type, [&](auto tag) {
      using T = typename decltype(tag)::type;
      const auto* from = reinterpret_cast<const T*>(turned_.data());
      for (Index z = piece.lo.z; z < piece.hi.z; ++z)
        for (Index y = piece.lo.y; y < piece.hi.y; ++y) {
          const Int3 p{piece.lo.x, y, z};
          T* to = reinterpret_cast<T*>(out) + linear_index(p - box.lo, box.extent());
          const T* row = from + (y - piece.lo.y) * step.y + (z - piece.lo.z) * step.z;
          for (Index x = 0; x < piece.extent().x; ++x) to[x] = row[x * step.x];
        }
    });
  }

  VolumeInfo info_;
  std::unique_ptr<Hdf5Dataset> dataset_;
  ArrayView view_;
  std::vector<Index> fixed_;  ///< where on each axis; those of space are filled in
  bool in_order_;             ///< x is the fastest of them in the file, z the slowest
  PodBuffer<std::byte> turned_;
};

/// The spacing of x, y and z from that of the axes as the file has them.
Vec3d spacing_of(const ArrayView& view, Vec3d in_file) {
  Vec3d spacing;
  for (int axis = 0; axis < 3; ++axis) {
    int place = 0;  // of this axis among those of space
    for (const std::size_t other : view.kept)
      place += other < view.kept[static_cast<std::size_t>(axis)];
    spacing[axis] = in_file[place];
  }
  return spacing;
}

/// Labels of some dimensions leave the others open. A labelled dimension must have the place that
/// its label names.
void check_directions(const std::string& path, std::span<const ArrayAxis> axes) {
  int next = 0;
  for (const ArrayAxis& axis : axes) {
    const bool is_space = axis.role == AxisRole::space;
    const int place = is_space ? next++ : -1;
    if (!axis.direction || *axis.direction == place) continue;
    const char label = "xyz"[*axis.direction];
    throw UsageError(fmt::format(
        "'{}': DIMENSION_LABELS name a dimension {} that is taken for {}, since not all have a "
        "name: label all of them x, y, z, c or t",
        path, label, is_space ? std::string(1, "xyz"[std::min(place, 2)]) : "a channel or time"));
  }
}

}  // namespace

std::unique_ptr<VolumeSource> open_hdf5(const std::string& file, const std::string& dataset,
                                        const VolumeRequest& request) {
  refuse_raw_description(file, "an HDF5 file", request);
  auto opened = std::make_unique<Hdf5Dataset>(file, dataset, request.threads);
  std::vector<ArrayAxis> axes = opened->axes();
  if (!opened->labelled() && !guess_roles(axes, request.selection))
    throw UsageError(
        fmt::format("'{}': a dataset of {} dimensions, without DIMENSION_LABELS that "
                    "mark which 3 are space: {}",
                    file, axes.size(), kRolesHint));
  if (!opened->labelled()) check_directions(file, axes);
  const ArrayView view = select_volume(file, axes, request.selection);
  std::vector<Index> fixed(axes.size(), 0);
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (axes[i].size == 1 || axes[i].role == AxisRole::space) continue;
    fixed[i] = (axes[i].role == AxisRole::time ? request.selection.time : request.selection.channel)
                   .value_or(0);
  }
  Transform transform;
  if (opened->element_size().x > 0) {
    transform.spacing = spacing_of(view, opened->element_size());
    transform.unit = "micrometer";
  }
  const ScalarType type = opened->type();
  VolumeInfo info = describe_volume(file, view.extent, type, transform, request);
  return std::make_unique<Hdf5Source>(std::move(info), std::move(opened), view, std::move(fixed));
}

}  // namespace isobrick

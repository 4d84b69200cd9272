#include "io/volumes/dicom/dicom_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <semaphore>
#include <thread>
#include <utility>

#include <isobrick/error.h>
#include "io/volumes/dicom/dicom_slice.h"
#include "io/volumes/raw/text_header.h"

namespace isobrick::inline v0 {
namespace {

double length(Vec3d a) { return std::sqrt(dot(a, a)); }

/// Slices of one file each, or one file of frames.
class DicomSource final : public VolumeSource {
 public:
  DicomSource(VolumeInfo info, std::vector<DicomSlice> slices, bool scaled)
      : info_(std::move(info)), slices_(std::move(slices)), scaled_(scaled), room_(readers()) {}

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  std::size_t memory() const override {
    return static_cast<std::size_t>(readers()) * slice_memory() + slices_.size() * 512;
  }

  void read(Box3 box, std::byte* out) override {
    if (box.empty()) return;
    const Int3 e = info_.extent;
    const bool whole = box.extent().x == e.x && box.extent().y == e.y;
    const std::size_t plane =
        static_cast<std::size_t>(box.extent().x * box.extent().y) * size_of(info_.type);
    std::vector<std::byte> spare(whole ? 0
                                       : static_cast<std::size_t>(e.x * e.y) * size_of(info_.type));
    for (Index z = box.lo.z; z < box.hi.z; ++z, out += plane) {
      read_plane(z, whole ? out : spare.data());
      if (!whole) copy_part(spare.data(), box, out);
    }
  }

 private:
  /// Beside the plane itself: the file, and the frame as it is decompressed.
  std::size_t slice_memory() const {
    return static_cast<std::size_t>(info_.extent.x * info_.extent.y) *
               (2 * size_of(slices_[0].type) + size_of(info_.type)) +
           (std::size_t{1} << 18);
  }
  std::ptrdiff_t readers() const {
    constexpr std::size_t kEnough = std::size_t{64} << 20;
    const std::size_t most = std::max(1u, std::thread::hardware_concurrency());
    return static_cast<std::ptrdiff_t>(std::clamp<std::size_t>(kEnough / slice_memory(), 1, most));
  }

  void read_plane(Index z, std::byte* out) {
    const bool frames = slices_.size() == 1;
    const DicomSlice& slice = slices_[frames ? 0 : static_cast<std::size_t>(z)];
    const auto count = static_cast<std::size_t>(info_.extent.x * info_.extent.y);
    const std::size_t before = count * (size_of(info_.type) - size_of(slice.type));
    room_.acquire();
    try {
      read_dicom_frame(slice, frames ? z : 0, out + before);
    } catch (...) {
      room_.release();
      throw;
    }
    room_.release();
    if (scaled_) scale_in_place(slice.type, info_.type, count, slice.scale, out);
  }

  void copy_part(const std::byte* plane, Box3 box, std::byte* out) const {
    const std::size_t sample = size_of(info_.type);
    const auto row = static_cast<std::size_t>(box.extent().x) * sample;
    for (Index y = box.lo.y; y < box.hi.y; ++y, out += row)
      std::copy_n(plane + static_cast<std::size_t>(y * info_.extent.x + box.lo.x) * sample, row,
                  out);
  }

  VolumeInfo info_;
  std::vector<DicomSlice> slices_;
  bool scaled_;
  std::counting_semaphore<> room_;
};

std::vector<DicomSlice> read_slices(const std::string& name,
                                    const std::vector<std::string>& files) {
  std::vector<DicomSlice> slices;
  std::map<std::string, std::size_t> series;
  for (const std::string& file : files)
    if (auto slice = read_dicom_slice(file)) {
      ++series[slice->series];
      slices.push_back(std::move(*slice));
    }
  if (slices.empty()) throw UsageError(fmt::format("'{}' holds no DICOM images", name));
  if (series.size() > 1) {
    std::string list;
    for (const auto& [uid, count] : series)
      if (list.size() < 300)
        list +=
            fmt::format("{}{} of {}", list.empty() ? "" : ", ", count, uid.empty() ? "none" : uid);
    throw UsageError(
        fmt::format("'{}' holds {} DICOM series ({}): put each into a folder of its own", name,
                    series.size(), list));
  }
  return slices;
}

void check_alike(const DicomSlice& first, const DicomSlice& other) {
  const auto differ = [&](const char* what) {
    throw UsageError(
        fmt::format("'{}' has {} than '{}', of the same series", other.path, what, first.path));
  };
  if (other.extent != first.extent) differ("another extent");
  if (other.type != first.type || other.bits != first.bits) differ("samples of another type");
  if (other.position.has_value() != first.position.has_value())
    differ("more or less of a position");
  if (std::abs(other.spacing.x - first.spacing.x) > 1e-3 * first.spacing.x ||
      std::abs(other.spacing.y - first.spacing.y) > 1e-3 * first.spacing.y)
    differ("another spacing of its pixels");
  if (length(other.row - first.row) > 1e-3 || length(other.column - first.column) > 1e-3)
    differ("another orientation");
}

/// How far along the normal of the slices one of them lies.
double height_of(const DicomSlice& slice) {
  return slice.position ? dot(*slice.position, cross(slice.row, slice.column))
                        : static_cast<double>(slice.instance);
}

/// Of slices sorted by height, those of one time: each place has as many slices.
std::vector<DicomSlice> choose_time(const std::string& name, std::vector<DicomSlice> sorted,
                                    const Selection& selection) {
  const auto same = [](const DicomSlice& a, const DicomSlice& b) {
    return std::abs(height_of(a) - height_of(b)) <= 1e-4;
  };
  std::size_t times = 1;
  while (times < sorted.size() && same(sorted[0], sorted[times])) ++times;
  for (std::size_t i = 0; i < sorted.size(); i += times)
    for (std::size_t j = 0; j <= times && i + j < sorted.size(); ++j)
      if (same(sorted[i], sorted[i + j]) != (j < times) || sorted.size() % times != 0)
        throw UsageError(
            fmt::format("'{}': some places have {} slices and others not ('{}'): these "
                        "are no complete times",
                        name, times, sorted[i + j].path));
  const auto time =
      static_cast<std::size_t>(choose(name, "--time", static_cast<Index>(times), selection.time));
  std::vector<DicomSlice> chosen;
  for (std::size_t i = 0; i < sorted.size(); i += times) {
    const auto from = sorted.begin() + static_cast<std::ptrdiff_t>(i);
    std::sort(from, from + static_cast<std::ptrdiff_t>(times),
              [](const DicomSlice& a, const DicomSlice& b) {
                return std::pair(a.time, a.instance) < std::pair(b.time, b.instance);
              });
    chosen.push_back(sorted[i + time]);
  }
  return chosen;
}

/// From each slice to the next.
std::vector<double> steps_of(const std::vector<DicomSlice>& slices) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < slices.size(); ++i)
    steps.push_back(height_of(slices[i]) - height_of(slices[i - 1]));
  return steps;
}

[[noreturn]] void refuse_step(const std::string& name, const DicomSlice& before,
                              const DicomSlice& after, double step, double usual) {
  const double steps = std::round(step / usual);
  if (steps >= 2 && std::abs(step - steps * usual) <= step_tolerance(step))
    throw UsageError(fmt::format(
        "'{}': {} missing between '{}' and '{}', which are {:.4g} mm apart: elsewhere the step is "
        "{:.4g} mm",
        name, steps == 2 ? "a slice is" : fmt::format("{} slices are", steps - 1), before.path,
        after.path, step, usual));
  throw UsageError(fmt::format(
      "'{}': the slices are not evenly spaced: '{}' lies {:.4g} mm behind '{}', elsewhere the step "
      "is {:.4g} mm",
      name, after.path, step, before.path, usual));
}

/// The distance of frames must be in the file or the request.
void check_frame_step(const DicomSlice& slice, const VolumeRequest& request) {
  if (slice.extent.z < 2 || slice.has_frame_step || request.spacing) return;
  throw UsageError(
      fmt::format("'{}' does not state how far apart its {} frames lie (GridFrameOffsetVector of a "
                  "dose, else SpacingBetweenSlices or SliceThickness): add --spacing X,Y,Z",
                  slice.path, slice.extent.z));
}

/// Without positions only the InstanceNumbers of slices show whether one is missing. With a
/// spacing that the user gives they are taken as they are.
void check_numbers(const std::string& name, const std::vector<DicomSlice>& slices) {
  const double usual = usual_step(steps_of(slices));
  for (std::size_t i = 1; i < slices.size(); ++i) {
    const DicomSlice &before = slices[i - 1], &after = slices[i];
    if (static_cast<double>(after.instance - before.instance) != usual)
      throw UsageError(fmt::format(
          "'{}': slices without positions, of which one seems to be missing between '{}' and '{}', "
          "whose InstanceNumbers are {} and {}: add it, or --spacing X,Y,Z to take them as evenly "
          "spaced",
          name, before.path, after.path, before.instance, after.instance));
  }
}

/// From one slice to the next, which must be the same throughout and along the
/// normal.
double find_step(const std::string& name, const std::vector<DicomSlice>& slices,
                 const VolumeRequest& request) {
  if (slices.size() > 1 && !slices[0].position && !request.spacing) check_numbers(name, slices);
  if (slices.size() < 2 || !slices[0].position) return slices[0].spacing.z;
  const Vec3d normal = cross(slices[0].row, slices[0].column);
  const auto last = static_cast<double>(slices.size() - 1);
  const double step = (height_of(slices.back()) - height_of(slices[0])) / last;
  const double usual = usual_step(steps_of(slices));
  for (std::size_t i = 1; i < slices.size(); ++i) {
    const Vec3d way = *slices[i].position - *slices[i - 1].position;
    const double up = dot(way, normal);
    const double tolerance = step_tolerance(usual);
    if (std::abs(up - usual) > tolerance) refuse_step(name, slices[i - 1], slices[i], up, usual);
    if (length(way - normal * up) > tolerance)
      throw UsageError(
          fmt::format("'{}': '{}' is shifted sideways against '{}' (a tilted gantry?), "
                      "which is not supported",
                      name, slices[i].path, slices[i - 1].path));
  }
  return step;
}

/// What samples become by the slices' scales: integers stay integers where the scales let them.
ScalarType real_type(const std::vector<DicomSlice>& slices) {
  const DicomSlice& first = slices[0];
  std::vector<ValueScale> scales;
  for (const DicomSlice& slice : slices) scales.push_back(slice.scale);
  const bool is_signed = visit_scalar(first.type, [](auto tag) {
    return std::numeric_limits<typename decltype(tag)::type>::is_signed;
  });
  const double span = std::exp2(first.bits);
  return integer_scaled_type(first.type, is_signed ? -span / 2 : 0,
                             (is_signed ? span / 2 : span) - 1, scales)
      .value_or(scaled_type(first.type));
}

}  // namespace

std::unique_ptr<VolumeSource> open_dicom(const std::string& name,
                                         const std::vector<std::string>& files,
                                         const VolumeRequest& request) {
  refuse_raw_description(name, "a DICOM series", request);
  std::vector<DicomSlice> slices = read_slices(name, files);
  for (const DicomSlice& slice : slices) check_alike(slices[0], slice);
  const DicomSlice first = slices[0];
  if (slices.size() > 1 && first.extent.z > 1)
    throw UsageError(
        fmt::format("'{}' holds several files of several frames each: give one of them", name));
  check_frame_step(first, request);
  choose(name, "--channel", 1, request.selection.channel);
  std::sort(slices.begin(), slices.end(),
            [](const DicomSlice& a, const DicomSlice& b) { return height_of(a) < height_of(b); });
  slices = choose_time(name, std::move(slices), request.selection);
  bool scaled = false;
  for (const DicomSlice& slice : slices) scaled = scaled || !slice.scale.identity();
  Transform transform;
  const Vec3d normal = cross(first.row, first.column);
  const Vec3d axes[3] = {first.row * first.spacing.x, first.column * first.spacing.y,
                         normal * find_step(name, slices, request)};
  set_axes(name, transform, axes);
  transform.origin = slices[0].position.value_or(Vec3d{0, 0, 0});
  transform.unit = "millimeter";
  const Index planes = slices.size() == 1 ? first.extent.z : static_cast<Index>(slices.size());
  VolumeInfo info = describe_volume(name, {first.extent.x, first.extent.y, planes},
                                    scaled ? real_type(slices) : first.type, transform, request);
  info.files.assign(files.begin(), files.end());
  return std::make_unique<DicomSource>(std::move(info), std::move(slices), scaled);
}

}  // namespace isobrick

#include "io/volumes/tiff/tiff_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>

#include <isobrick/error.h>
#include "io/volumes/raw/raw_source.h"
#include "io/volumes/tiff/tiff_description.h"
#include "io/volumes/tiff/tiff_page.h"

namespace isobrick::inline v0 {
namespace {

/// Where a page is.
struct Place {
  std::uint32_t file = 0;
  std::uint64_t offset = 0;
};

/// All pages, which are alike.
struct Pages {
  TiffPage page;
  std::vector<Place> places;
  TiffDescription description;
  double resolution[2] = {0, 0};
  std::size_t memory = 0;  ///< of one open file
};

void check_alike(const std::string& file, std::size_t page, const TiffPage& first,
                 const TiffPage& other) {
  if (other == first) return;
  const auto words = [](const TiffPage& p) {
    return fmt::format("{} x {} pixels of {} {}", p.width, p.height, p.samples, short_name(p.type));
  };
  throw UsageError(fmt::format("'{}': page {} has {}, but the first one of the stack has {}", file,
                               page, words(other), words(first)));
}

Pages find_pages(const std::vector<std::string>& files) {
  Pages pages;
  for (std::uint32_t f = 0; f < files.size(); ++f) {
    TiffFile file(files[f]);
    std::size_t number = 0;
    do {
      if (file.is_reduced()) continue;
      const TiffPage page = file.page();
      if (pages.places.empty()) {
        pages.page = page;
        pages.description = parse_tiff_description(files[f], file.description());
        for (int axis = 0; axis < 2; ++axis) pages.resolution[axis] = file.resolution(axis);
      }
      check_alike(files[f], number++, pages.page, page);
      pages.memory = std::max(pages.memory, file.memory());
      pages.places.push_back({f, file.offset()});
    } while (file.next_page());
  }
  if (pages.places.empty()) throw UsageError(fmt::format("'{}' has no pages", files[0]));
  return pages;
}

/// Open files that threads share: each takes one for as long as it reads a page.
class FilePool {
 public:
  FilePool(std::vector<std::string> paths, std::size_t memory_of_one)
      : paths_(std::move(paths)), memory_of_one_(memory_of_one) {
    constexpr std::size_t kEnough = std::size_t{64} << 20;
    max_ = std::clamp<std::size_t>(kEnough / memory_of_one, 1,
                                   std::max(1u, std::thread::hardware_concurrency()));
  }

  std::size_t memory() const { return max_ * memory_of_one_; }

  /// Calls f(TiffFile&) with a file that is open at `place`.
  template <class F>
  void use(Place place, F&& f) {
    Slot slot = take(place.file);
    try {
      if (!slot.file) slot = {std::make_unique<TiffFile>(paths_[place.file]), place.file};
      slot.file->go_to(place.offset);
      f(*slot.file);
    } catch (...) {
      give({});
      throw;
    }
    give(std::move(slot));
  }

 private:
  struct Slot {
    std::unique_ptr<TiffFile> file;
    std::uint32_t index = 0;
  };

  /// An idle slot with this file, else an empty one.
  Slot take(std::uint32_t index) {
    std::unique_lock lock(mutex_);
    free_.wait(lock, [&] { return taken_ < max_; });
    ++taken_;
    const auto at = std::find_if(idle_.begin(), idle_.end(),
                                 [&](const Slot& slot) { return slot.index == index; });
    Slot slot;
    if (at != idle_.end()) {
      slot = std::move(*at);
      idle_.erase(at);
    } else if (!idle_.empty() && taken_ + idle_.size() > max_) {
      idle_.pop_back();
    }
    return slot;
  }

  void give(Slot slot) {
    {
      const std::lock_guard lock(mutex_);
      --taken_;
      if (slot.file) idle_.push_back(std::move(slot));
    }
    free_.notify_one();
  }

  std::vector<std::string> paths_;
  std::size_t memory_of_one_, max_;
  std::mutex mutex_;
  std::condition_variable free_;
  std::vector<Slot> idle_;
  std::size_t taken_ = 0;
};

class TiffSource final : public VolumeSource {
 public:
  TiffSource(VolumeInfo info, std::vector<std::string> files, std::size_t memory,
             std::vector<Place> places, Index first, Index step, std::uint16_t sample)
      : info_(std::move(info)),
        pool_(std::move(files), memory),
        places_(std::move(places)),
        first_(first),
        step_(step),
        sample_(sample) {}

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  std::size_t memory() const override { return pool_.memory() + places_.size() * sizeof(Place); }

  void read(Box3 box, std::byte* out) override {
    if (box.empty()) return;
    const auto plane =
        static_cast<std::size_t>(box.extent().x * box.extent().y) * size_of(info_.type);
    const auto n = [](Index i) { return static_cast<std::uint32_t>(i); };
    for (Index z = box.lo.z; z < box.hi.z; ++z, out += plane)
      pool_.use(places_[static_cast<std::size_t>(first_ + z * step_)], [&](TiffFile& file) {
        file.read(n(box.lo.x), n(box.lo.y), n(box.hi.x), n(box.hi.y), sample_, out);
      });
  }

 private:
  VolumeInfo info_;
  FilePool pool_;
  std::vector<Place> places_;
  Index first_, step_;  ///< the page of the first plane, and from one plane to the next
  std::uint16_t sample_;
};

Transform read_transform(const Pages& pages) {
  const TiffDescription& description = pages.description;
  Transform transform;
  transform.unit = description.unit;
  for (int axis = 0; axis < 3; ++axis) {
    double spacing = description.spacing[axis];
    // Elsewhere the resolution is that of a print.
    if (description.image_j && axis < 2 && pages.resolution[axis] > 0)
      spacing = 1 / pages.resolution[axis];
    if (spacing > 0) transform.spacing[axis] = spacing;
  }
  return transform;
}

/// ImageJ writes large stacks as one page, with the others behind it.
std::unique_ptr<VolumeSource> open_behind_first(const std::string& path, const Pages& pages,
                                                const ArrayView& view, VolumeInfo info) {
  TiffFile file(path);
  TiffFile::PlainSamples plain;
  if (!file.find_plain(plain))
    throw UsageError(fmt::format("'{}' has 1 page, but its description promises {}", path,
                                 view.total / pages.page.width / pages.page.height));
  SampleLayout layout;
  layout.info = std::move(info);
  layout.offset = plain.offset + static_cast<std::uint64_t>(view.first) * size_of(pages.page.type);
  layout.swap = plain.swap && size_of(pages.page.type) > 1;
  layout.stride = view.stride;
  File input = open_input(path);
  const std::uint64_t size = input.size();
  if (plain.offset > size || size < layout.end())
    throw UsageError(fmt::format("'{}' has {} bytes, but its description promises samples up to {}",
                                 path, size, layout.end()));
  return make_raw_source(std::move(layout), std::move(input));
}

}  // namespace

std::unique_ptr<VolumeSource> open_tiff(const std::string& name,
                                        const std::vector<std::string>& files,
                                        const VolumeRequest& request) {
  refuse_raw_description(name, "a TIFF stack", request);
  Pages pages = find_pages(files);
  const TiffDescription& description = pages.description;
  const auto count = static_cast<Index>(pages.places.size());
  const Index slices = description.slices > 0 ? description.slices : count;
  const Index promised = slices * description.channels * description.times;
  const bool behind = description.image_j && count == 1 && promised > 1 && files.size() == 1;
  // A folder of files each of which describes itself is a plain stack.
  const bool described = files.size() == 1;
  if (described && !behind && promised != count)
    throw UsageError(
        fmt::format("'{}' has {} pages, but its description promises {}", name, count, promised));
  std::vector<ArrayAxis> axes{{pages.page.samples, AxisRole::channel},
                              {pages.page.width, AxisRole::space},
                              {pages.page.height, AxisRole::space}};
  for (const char axis : described ? description.order : std::string("Z")) {
    if (axis == 'Z') axes.push_back({described ? slices : count, AxisRole::space});
    if (axis == 'C') axes.push_back({description.channels, AxisRole::channel});
    if (axis == 'T') axes.push_back({description.times, AxisRole::time});
  }
  const ArrayView view = select_volume(name, axes, request.selection);
  VolumeInfo info =
      describe_volume(name, view.extent, pages.page.type, read_transform(pages), request);
  info.files.assign(files.begin(), files.end());
  if (behind) return open_behind_first(files[0], pages, view, std::move(info));
  const Index plane = Index{pages.page.width} * pages.page.height * pages.page.samples;
  return std::make_unique<TiffSource>(std::move(info), files, pages.memory, std::move(pages.places),
                                      view.first / plane, view.stride.z / plane,
                                      static_cast<std::uint16_t>(view.first % pages.page.samples));
}

}  // namespace isobrick

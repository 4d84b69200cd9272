#include "viewer/render/picture_work.h"

#include <algorithm>
#include <array>
#include <limits>

namespace isobrick::inline v0 {
namespace {

/// Minimum rows of a call: a software driver works on tiles of this size.
constexpr int kMinRows = 64;

/// Time for a pixel, in hundredths of the time for a triangle in software (Mesa, 0.2 us).
std::uint64_t hundredths_of(ScreenPass::Step step) {
  switch (step) {
    case ScreenPass::Step::nearest: return 5;
    case ScreenPass::Step::occlusion: return 27;
    case ScreenPass::Step::smooth_rows:
    case ScreenPass::Step::smooth_columns: return 15;
    case ScreenPass::Step::compose: return 9;
  }
  return 0;
}

void take(std::uint64_t& work, std::uint64_t done) { work -= std::min(work, done); }

}  // namespace

void PictureWork::start(const PictureTargets& targets, const PictureSettings& settings) {
  *this = {};
  opaque_ = transparent_ =
      MeshQueue(settings.in_order ? MeshQueue::Order::added : MeshQueue::Order::blocks);
  steps_ = ScreenPass::steps(settings);
  width_ = targets.width;
  height_ = targets.height;
}

std::uint64_t PictureWork::row_work(std::size_t step) const {
  return (static_cast<std::uint64_t>(width_) * hundredths_of(steps_[step]) + 99) / 100;
}

std::uint64_t PictureWork::remaining() const {
  std::uint64_t sum = opaque_.triangles() + transparent_.triangles();
  for (std::size_t step = step_; step < steps_.size(); ++step)
    sum += row_work(step) * static_cast<std::uint64_t>(height_ - (step == step_ ? row_ : 0));
  return sum;
}

bool PictureWork::any_surfaces(const PicturePasses& passes, bool transparent) const {
  return !(transparent ? transparent_ : opaque_).empty() ||
         (!slices_drawn_[transparent ? 1 : 0] && passes.slices.any(transparent));
}

bool PictureWork::draw_surfaces(PicturePasses& passes, Vec3d eye, bool transparent,
                                std::uint64_t& work) {
  MeshQueue& queue = meshes(transparent);
  while (!queue.empty()) {
    if (work == 0) return false;
    const std::uint64_t before = queue.triangles();
    passes.meshes.draw(queue.take(std::min(work, passes.meshes.max_triangles())), eye, transparent);
    take(work, before - queue.triangles());
  }
  if (!std::exchange(slices_drawn_[transparent ? 1 : 0], true))
    passes.slices.draw(eye, transparent);
  return true;
}

bool PictureWork::run_steps(ScreenPass& screen, const ScreenPicture& picture, std::uint64_t& work) {
  while (step_ < steps_.size()) {
    if (work == 0) return false;
    const std::uint64_t each = row_work(step_);
    const auto fit = static_cast<int>(std::min<std::uint64_t>(
        work / each, static_cast<std::uint64_t>(std::numeric_limits<int>::max())));
    const int rows = std::min(std::max(fit, kMinRows), height_ - row_);
    screen.run(steps_[step_], picture, {row_, rows});
    take(work, each * static_cast<std::uint64_t>(rows));
    row_ += rows;
    if (row_ < height_) continue;
    row_ = 0;
    ++step_;
  }
  return true;
}

}  // namespace isobrick

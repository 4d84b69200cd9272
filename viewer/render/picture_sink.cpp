#include "viewer/render/picture_sink.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "core/vectors.h"
#include "viewer/render/preview_options.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kBatch = std::size_t{1} << 17;  ///< triangles that one call draws

/// Work of Renderer::advance() between two looks at a request to stop: some tenths of a second in
/// software.
constexpr std::uint64_t kWorkAtOnce = std::uint64_t{1} << 20;

const PictureSinkOptions& checked(const PictureSinkOptions& options) {
  for (const int edge : {options.width, options.height})
    if (edge < kMinPictureEdge || edge > kMaxPictureEdge)
      throw UsageError(fmt::format("a picture of {}x{} pixels: each edge must be {} to {}",
                                   options.width, options.height, kMinPictureEdge,
                                   kMaxPictureEdge));
  return options;
}

/// Makes the context current for one call.
class ContextGuard {
 public:
  explicit ContextGuard(GlContext& context) : context_(context) { context_.make_current(); }
  ~ContextGuard() { context_.release_current(); }
  ContextGuard(const ContextGuard&) = delete;
  ContextGuard& operator=(const ContextGuard&) = delete;

 private:
  GlContext& context_;
};

}  // namespace

PictureSink::PictureSink(const PictureSinkOptions& options) : options_(checked(options)) {
  renderer_name_ = current_gl_device().renderer;
  context_->release_current();
}

PictureSink::~PictureSink() {
  if (!context_) return;
  try {
    const ContextGuard guard(*context_);
    renderer_.reset();
  } catch (const Error&) {
    // Without its context OpenGL cannot be called. The context ends what the renderer owns there.
    static_cast<void>(renderer_.release());
  }
}

void PictureSink::set_style(const MeshStyle& style) {
  style_ = style;
  has_transparent_ |= style.opacity < 1;
}

std::uint64_t PictureSink::memory_with(const PictureSinkOptions& options, bool transparent) {
  // The batch and its upload; the pixels and their conversion for a file.
  constexpr std::uint64_t batch = 2 * kBatch * (sizeof(Triangle) + 2 * 2 * sizeof(Vec3f));
  const auto pixels =
      static_cast<std::uint64_t>(options.width) * static_cast<std::uint64_t>(options.height);
  return Renderer::driver_memory(1) - Renderer::driver_memory(0) +
         Renderer::memory(options.width, options.height, options.settings, transparent) +
         pixels * (4 + 3 + 4) + batch;
}

void PictureSink::begin(const MeshHeader& header) {
  if (unit_.empty()) unit_ = header.unit;
  scale_ = header.unit.empty() ? 1 : unit_ratio(header.unit, unit_).value_or(1);
  const MeshBounds bounds = header.surface.value_or(MeshBounds{header.world_lo, header.world_hi});
  max_bounds_ = {bounds.lo * scale_, bounds.hi * scale_};
  origin_ = (max_bounds_.lo + max_bounds_.hi) * 0.5;
}

void PictureSink::begin_picture(const MeshBounds& frame) {
  const ContextGuard guard(*context_);
  frame_ = frame;
  renderer_ = std::make_unique<Renderer>();
  const double aspect = static_cast<double>(options_.width) / options_.height;
  renderer_->begin(make_camera(options_.camera, frame.lo, frame.hi, aspect), options_.width,
                   options_.height, options_.settings);
}

MeshBounds PictureSink::bounds_of_batch() const {
  if (positions_.empty()) return max_bounds_;
  MeshBounds bounds{max_bounds_.hi, max_bounds_.lo};
  for (const Vec3f& position : positions_) {
    const Vec3d p = to_double(position) + origin_;
    for (int axis = 0; axis < 3; ++axis) {
      bounds.lo[axis] = std::fmin(bounds.lo[axis], std::fmax(p[axis], max_bounds_.lo[axis]));
      bounds.hi[axis] = std::fmax(bounds.hi[axis], std::fmin(p[axis], max_bounds_.hi[axis]));
    }
  }
  return bounds;
}

void PictureSink::write(const MeshChunk& chunk) {
  // All or none of a batch has normals.
  if (!positions_.empty() && normals_.empty() != chunk.normals.empty()) draw_batch();
  for (std::span<const Triangle> left = chunk.triangles; !left.empty();) {
    if (triangles_.size() == kBatch) draw_batch();
    const std::size_t count = std::min(left.size(), kBatch - triangles_.size());
    add(chunk, left.first(count));
    left = left.subspan(count);
  }
}

/// Adds triangles of a chunk to the batch, with all vertices from their first to their last.
void PictureSink::add(const MeshChunk& chunk, std::span<const Triangle> triangles) {
  std::uint32_t lo = triangles.front()[0], hi = lo;
  for (const Triangle& t : triangles) {
    lo = std::min({lo, t[0], t[1], t[2]});
    hi = std::max({hi, t[0], t[1], t[2]});
  }
  const auto first = static_cast<std::uint32_t>(positions_.size());
  const std::size_t count = std::size_t{hi} - lo + 1;
  for (const Vec3f& p : chunk.positions.subspan(lo, count))
    positions_.push_back(to_float(to_double(p) * scale_ - origin_));
  if (!chunk.normals.empty()) {
    const auto normals = chunk.normals.subspan(lo, count);
    normals_.insert(normals_.end(), normals.begin(), normals.end());
  }
  for (const Triangle& t : triangles)
    triangles_.push_back({t[0] - lo + first, t[1] - lo + first, t[2] - lo + first});
}

void PictureSink::draw_batch() {
  if (triangles_.empty()) return;
  if (!renderer_) begin_picture(options_.frame.value_or(max_bounds_));
  const ContextGuard guard(*context_);
  renderer_->draw({0, positions_, normals_, triangles_}, style_, origin_);
  positions_.clear();
  normals_.clear();
  triangles_.clear();
}

void PictureSink::finish() {
  // If nothing was drawn yet, this batch is the whole mesh.
  if (!renderer_) begin_picture(options_.frame ? *options_.frame : bounds_of_batch());
  draw_batch();
}

void PictureSink::draw_overlays() {
  if (options_.box) renderer_->draw_box(frame_.lo, frame_.hi, {0.36f, 0.40f, 0.46f});
  if (options_.axes) renderer_->draw_axes();
  if (!options_.scale_bar) return;
  const std::string& requested = options_.scale_bar_unit;
  if (requested.empty()) return renderer_->draw_scale_bar(unit_symbol(unit_));
  if (unit_.empty())
    throw UsageError(
        fmt::format("the mesh has no unit, so that a scale bar cannot be in {}; without a unit it "
                    "counts in the mesh's own",
                    requested));
  renderer_->draw_scale_bar(unit_symbol(requested), unit_ratio(requested, unit_).value_or(1));
}

std::vector<std::uint8_t> PictureSink::end(const std::stop_token& cancel) {
  if (!context_) throw Error("the picture is finished already");
  if (!renderer_) begin_picture(options_.frame.value_or(max_bounds_));
  std::vector<std::uint8_t> rgba;
  {
    const ContextGuard guard(*context_);
    draw_overlays();
    while (!renderer_->advance(kWorkAtOnce))
      if (cancel.stop_requested()) throw Cancelled("the picture was cancelled");
    rgba = renderer_->read_pixels();
    renderer_.reset();
  }
  context_.reset();
  positions_ = {};
  normals_ = {};
  triangles_ = {};
  return rgba;
}

}  // namespace isobrick

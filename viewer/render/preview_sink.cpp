#include "viewer/render/preview_sink.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <isobrick/error.h>
#include "core/vectors.h"
#include "io/bytes/png_file.h"
#include "viewer/render/camera_request.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kBatch = std::size_t{1} << 17;  ///< triangles that one call draws

const PreviewOptions& checked(const PreviewOptions& options) {
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

PreviewSink::PreviewSink(std::string path, bool force, const PreviewOptions& options)
    : options_(checked(options)), out_(std::move(path), force) {
  context_->release_current();
}

PreviewSink::~PreviewSink() {
  if (!context_) return;
  try {
    const ContextGuard guard(*context_);
    renderer_.reset();
  } catch (const Error&) {
    // Without its context OpenGL cannot be called. The context ends what the renderer owns there.
    static_cast<void>(renderer_.release());
  }
}

std::uint64_t PreviewSink::memory_with(const PreviewOptions& options) {
  // The batch and its upload; the pixels and their conversion for the file.
  constexpr std::uint64_t batch = 2 * kBatch * (sizeof(Triangle) + 2 * 2 * sizeof(Vec3f));
  const auto pixels =
      static_cast<std::uint64_t>(options.width) * static_cast<std::uint64_t>(options.height);
  return Renderer::driver_memory(1) - Renderer::driver_memory(0) +
         Renderer::memory(options.width, options.height, {}, false) + pixels * (4 + 3 + 4) + batch;
}

void PreviewSink::begin(const MeshHeader& header) {
  max_bounds_ = header.surface.value_or(MeshBounds{header.world_lo, header.world_hi});
  origin_ = (max_bounds_.lo + max_bounds_.hi) * 0.5;
}

void PreviewSink::begin_picture(const MeshBounds& frame) {
  const ContextGuard guard(*context_);
  renderer_ = std::make_unique<Renderer>();
  const double aspect = static_cast<double>(options_.width) / options_.height;
  renderer_->begin(make_camera(options_.camera, frame.lo, frame.hi, aspect), options_.width,
                   options_.height, {});
}

MeshBounds PreviewSink::bounds_of_batch() const {
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

void PreviewSink::write(const MeshChunk& chunk) {
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
void PreviewSink::add(const MeshChunk& chunk, std::span<const Triangle> triangles) {
  std::uint32_t lo = triangles.front()[0], hi = lo;
  for (const Triangle& t : triangles) {
    lo = std::min({lo, t[0], t[1], t[2]});
    hi = std::max({hi, t[0], t[1], t[2]});
  }
  const auto first = static_cast<std::uint32_t>(positions_.size());
  const std::size_t count = std::size_t{hi} - lo + 1;
  for (const Vec3f& p : chunk.positions.subspan(lo, count))
    positions_.push_back(to_float(to_double(p) - origin_));
  if (!chunk.normals.empty()) {
    const auto normals = chunk.normals.subspan(lo, count);
    normals_.insert(normals_.end(), normals.begin(), normals.end());
  }
  for (const Triangle& t : triangles)
    triangles_.push_back({t[0] - lo + first, t[1] - lo + first, t[2] - lo + first});
}

void PreviewSink::draw_batch() {
  if (triangles_.empty()) return;
  if (!renderer_) begin_picture(max_bounds_);
  const ContextGuard guard(*context_);
  renderer_->draw({0, positions_, normals_, triangles_}, {.colour = options_.colour}, origin_);
  positions_.clear();
  normals_.clear();
  triangles_.clear();
}

void PreviewSink::finish() {
  // If nothing was drawn yet, this batch is the whole mesh.
  if (!renderer_) begin_picture(bounds_of_batch());
  draw_batch();
  {
    const ContextGuard guard(*context_);
    renderer_->end();
    write_png(out_, options_.width, options_.height, without_alpha(renderer_->read_pixels()));
    renderer_.reset();
  }
  context_.reset();
  positions_ = {};
  normals_ = {};
  triangles_ = {};
}

}  // namespace isobrick

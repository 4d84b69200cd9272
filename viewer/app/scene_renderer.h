#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <future>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "viewer/app/batch_pacer.h"
#include "viewer/app/clip_region.h"
#include "viewer/app/device_meshes.h"
#include "viewer/app/frame_pacer.h"
#include "viewer/app/mesh_uploads.h"
#include "viewer/app/picture_setup.h"
#include "viewer/app/slice_views.h"
#include "viewer/app/view_settings.h"
#include "viewer/render/renderer.h"
#include "viewer/scene/scene.h"

namespace isobrick::inline v0 {

/// Seconds of a draw batch in software: input is handled in between.
inline constexpr double kBatchSeconds = 0.045;

/// The state of the shown frame and of the one being drawn.
struct FrameState {
  /// The frame is final: it is no preview, and no finer mesh or other slice will arrive.
  bool complete = false;
  bool drawing = false;       ///< a frame is unfinished; the next draw() continues it
  double drawn_fraction = 0;  ///< of the unfinished frame, 0 … 1
  /// The shown isovalue of each surface, by the surface's index. It differs from the settings until
  /// the requested isovalue covers the view. NaN: nothing is drawn.
  std::vector<double> isovalues;
  bool covers = false;  ///< every surface is shown at its isovalue without holes, however coarse
  std::uint64_t triangles = 0, nodes = 0;
  bool reduced_quality = false;     ///< without occlusion and multisampling, to be fast
  bool moving = false;              ///< a preview, drawn with FrameOptions::moving
  std::uint64_t device_bytes = 0;   ///< allocated for meshes and slices
  bool needs_draw = false;          ///< the next draw() has work, without any new event
  bool limited = false;             ///< limited by FrameOptions::max_triangles or memory
  bool thin_over_budget = false;    ///< exceeds FrameOptions::max_triangles, for thin structure
  bool limited_by_budget = false;   ///< more memory would make it finer
  std::vector<std::string> damage;  ///< a message for each node that cannot be shown
};

/// Allowed simplifications of a frame.
struct FrameOptions {
  std::uint64_t max_triangles = FramePacer::kAllTriangles;
  /// Maximum triangles where coarse levels have lost thin structure; see CutBudget.
  std::uint64_t thin_triangles = 0;
  /// Reduced quality is without occlusion and multisampling. `reduced_until_complete`: until no
  /// finer mesh will arrive; in software until one reduced frame is complete.
  enum class Quality : std::uint8_t { full, reduced_until_complete, reduced };
  Quality quality = Quality::full;
  /// A frame that takes longer is drawn in batches of about this time, one for each draw(). It has
  /// the same pixels, is shown when finished, and is dropped if the view changes before. Only
  /// software needs it: a device draws a whole picture in about a frame's time.
  double batch_seconds = std::numeric_limits<double>::infinity();
  /// The view changes all the time: an unfinished frame is finished in any case, unless the next
  /// one has much fewer triangles.
  bool moving = false;
  /// The picture is shown enlarged by this factor. If it is more than 1, box, axes and scale bar
  /// are drawn at the target's size.
  int size_divisor = 1;
  /// Scale of the display; see PictureSettings::overlay_scale.
  float overlay_scale = 1;
  /// The same pixels whatever the order in which meshes arrived. It is slower on a device; software
  /// always does so.
  bool in_order = false;

  /// The options of a window, which `pacer` simplifies during motion. `software`: whether OpenGL
  /// is.
  static FrameOptions in_window(const FramePacer& pacer, bool software, bool moving);
};

/// Numbers of frames so far.
struct FrameCounters {
  std::uint64_t finished = 0, dropped = 0;
  std::uint64_t unfinished_batches = 0;  ///< batches after which a frame was unfinished
};

/// Seconds of the steps of a draw() on this thread. If it drew nothing, `lock` to `finish` are 0.
struct FrameTimes {
  double device = 0;  ///< taking over a device, or importing its memory
  double scene = 0;
  double drawable = 0;  ///< finding the meshes to draw
  double upload = 0;    ///< uploading meshes
  double slices = 0;
  double lock = 0;    ///< waiting for a device that also makes meshes
  double draw = 0;    ///< submitting to OpenGL
  double finish = 0;  ///< waiting for OpenGL
  double tidy = 0;    ///< dropping meshes
};

/// Draws a store: chooses nodes for a view, uploads their meshes, and draws frames. The same for
/// windows and off-screen. For one thread, with the context current in which it was made.
class SceneRenderer {
 public:
  /// Reads the ranges. `on_change` is called from worker threads when a new frame would show more.
  /// `setup`: of the current context, for the lifetime of this; null: makes its own. Throws what
  /// Scene, PictureSetup and DeviceMeshes::use() throw.
  SceneRenderer(std::shared_ptr<const StoreReader> store, const PictureBudgets& budgets,
                std::function<void()> on_change, std::shared_ptr<PictureSetup> setup = nullptr);
  ~SceneRenderer();

  const StoreReader& store() const { return *store_; }
  Scene& scene() { return *scene_; }
  Renderer& renderer() { return setup_->renderer(); }
  DeviceMeshes& device() { return *device_; }

  /// The axis-aligned bounding box of the volume in world space.
  WorldBox bounds() const;
  /// The bounding box of what these settings show: the active blocks of 16³ cells of shown
  /// surfaces, and slices, within axis clips and region. bounds() if they show nothing. May read
  /// ranges, and throws what that throws.
  WorldBox shown_bounds(const ViewSettings& settings) const;

  /// Draws a frame of the present meshes, or continues the unfinished one. The previous picture
  /// stays until the new one is finished, and if the new one would be equal. Throws what Scene,
  /// Renderer and DeviceMeshes throw; then an unfinished frame is dropped.
  void draw(const Camera& camera, int width, int height, const ViewSettings& settings,
            const FrameOptions& options = {});
  const FrameState& state() const { return state_; }
  /// Whether the last draw() finished a frame.
  bool has_new_frame() const { return has_new_frame_; }
  /// Seconds of drawing the last finished frame, in all of its batches.
  double frame_seconds() const { return frame_seconds_; }
  const FrameCounters& counters() const { return counters_; }
  /// Of the last draw().
  const FrameTimes& times() const { return times_; }

  /// Draws until the frame is complete. Calls `wait` in between, about ten times a second; it may
  /// throw.
  void draw_complete(const Camera& camera, int width, int height, const ViewSettings& settings,
                     const std::function<void()>& wait);

 private:
  /// What a frame depends on, besides the present meshes and slices.
  struct FrameKey {
    Camera camera;
    int width = 0, height = 0;
    ViewSettings settings;  ///< without isovalues: the meshes determine them
    friend bool operator==(const FrameKey&, const FrameKey&) = default;
  };
  /// The arguments of draw(), and the state of the scene.
  struct FrameRequest {
    const Camera& camera;
    int width, height;
    const ViewSettings& settings;
    const FrameOptions& options;
    FrameKey key, reduced_key;
    bool idle;  ///< no finer mesh than in `newest` will arrive
    std::shared_ptr<const Drawable> newest;
  };
  /// The content of a frame.
  struct ShownFrame {
    FrameKey key;
    std::shared_ptr<const Drawable> meshes;
    SliceViews::Samples slices;
    std::vector<double> isovalues;
    bool stale = false;  ///< newer meshes or slices exist; these were released
  };
  /// An unfinished frame.
  struct PendingFrame {
    ShownFrame frame;
    FrameState state;               ///< becomes part of state_
    std::vector<double> isovalues;  ///< requested
    std::uint64_t total_work = 0;   ///< work when it was begun
    double seconds = 0;             ///< drawing time so far
  };

  void draw_frame(const Camera& camera, int width, int height, const ViewSettings& settings,
                  const FrameOptions& options);
  void update_scene(const Camera& camera, int width, int height, const ViewSettings& settings,
                    const FrameOptions& options);
  /// Uploads meshes of the newest drawable; shows it once all are uploaded.
  void upload(const std::shared_ptr<const Drawable>& newest);
  bool can_wait(const Drawable& newest) const;
  bool may_reduce_quality(const FrameRequest& request) const;
  std::uint64_t upload_memory() const;
  void drop_unused();
  bool is_still_needed(const PendingFrame& pending, const FrameRequest& request) const;
  bool has_nothing_new(const ShownFrame& next, const FrameRequest& request) const;
  void choose_frame(const FrameRequest& request);
  void begin_frame(const FrameRequest& request);
  void draw_batch(double limit_seconds);
  void wait_for_gl(bool everything);
  void finish_frame();
  void drop_frame();
  std::optional<std::size_t> surface_of(const NodeDraw& node, const ViewSettings& settings) const;
  void draw_surfaces(const ViewSettings& settings, const PictureSettings& picture,
                     FrameState& state);
  void update_state(const FrameRequest& request);

  std::shared_ptr<const StoreReader> store_;
  PictureBudgets budgets_;
  std::future<std::unique_ptr<Scene>> scene_future_;  ///< read while OpenGL is set up
  std::shared_ptr<PictureSetup> setup_;
  MeshUploads uploads_;
  SliceViews slices_;
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<DeviceMeshes> device_;
  std::shared_ptr<const Drawable> shown_meshes_, next_meshes_;
  std::vector<std::size_t> shown_surfaces_;  ///< the surface of each isovalue of the scene
  ShownFrame shown_frame_;                   ///< the finished frame
  std::optional<PendingFrame> pending_;      ///< `shown_meshes_` does not change meanwhile
  BatchPacer batch_pacer_;
  std::optional<GlFence>
      batch_fence_;  ///< after the last batch of `pending_`, if it may be unfinished
  std::chrono::steady_clock::time_point finish_time_;  ///< of the last finished frame
  double frame_seconds_ = 0;
  bool has_new_frame_ = false;
  bool imported_block_ = false;  ///< the last draw() imported a block of device memory
  FrameCounters counters_;
  FrameState state_;
  FrameTimes times_;
};

}  // namespace isobrick

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

namespace isobrick {

/// How long a piece of a picture may take where OpenGL is software: input is answered in between.
inline constexpr double kBatchSeconds = 0.045;

/// What a picture shows and what it still lacks.
struct FrameState {
  /// Nothing finer, nothing else is on its options, and it is no preview.
  bool complete = false;
  bool drawing = false;       ///< a picture has been begun, and the next draw() goes on with it
  double drawn_fraction = 0;  ///< of that one, 0 … 1
  /// Of each surface that is drawn, by its number: at first, and while the one that was request
  /// for does not cover the view, not the settings'. NaN: nothing of it is drawn.
  std::vector<double> isovalues;
  bool covers = false;  ///< every surface at its isovalue, without holes, however coarse
  std::uint64_t triangles = 0, nodes = 0;
  bool reduced_quality = false;     ///< drawn without occlusion and multisampling to be quick
  bool moving = false;              ///< a preview: drawn as FrameOptions::moving
  std::uint64_t device_bytes = 0;   ///< taken for meshes and slices
  bool needs_draw = false;          ///< the next draw() has something to do, whatever comes
  bool limited = false;             ///< by FrameOptions::max_triangles, or by memory
  bool thin_over_budget = false;    ///< more than FrameOptions::max_triangles, for thin structure
  bool limited_by_budget = false;   ///< with more memory it would be finer
  std::vector<std::string> damage;  ///< messages, one for each node that cannot be shown
};

/// How a picture may be simpler than its settings say.
struct FrameOptions {
  std::uint64_t max_triangles = FramePacer::kAllTriangles;
  /// So many where coarse levels have lost thin structure; see CutBudget.
  std::uint64_t thin_triangles = 0;
  /// Without occlusion and multisampling; `until_complete`: unless nothing finer is to come. In
  /// software, which draws slowly, that is one picture later: first a plain one of all.
  enum class Quality : std::uint8_t {
    full,
    reduced_until_complete,
    reduced
  } quality = Quality::full;
  /// A picture that would take longer is drawn in pieces of about so many seconds, one with each
  /// draw(): the same picture, shown when it is whole, dropped when the view changes before. Only
  /// software needs them: a device draws a whole picture in about a frame.
  double batch_seconds = std::numeric_limits<double>::infinity();
  /// The view changes all the time: a picture that has been begun is finished all the same, unless
  /// there are much fewer triangles to draw by now.
  bool moving = false;
  /// Divisor of the width and height that it is shown with. Where it is more than 1, box, axes and
  /// scale bar are drawn there, and as large as always.
  int size_divisor = 1;
  /// Of the display: text, axes and lines are so much larger at least.
  float overlay_scale = 1;
  /// The same picture every time, whichever mesh came first. A device takes longer for it; in
  /// software it is always so.
  bool in_order = false;

  /// As windows draw, whose pictures become simpler as `pacer` says while something moves.
  /// `software`: whether OpenGL is.
  static FrameOptions in_window(const FramePacer& pacer, bool software, bool moving);
};

/// What has become of pictures so far.
struct FrameCounters {
  std::uint64_t finished = 0, dropped = 0;
  std::uint64_t unfinished_batches = 0;  ///< after which a picture was not finished yet
};

/// Seconds that the steps of a draw() took this thread; where nothing was drawn, from `turn` to
/// `finish` are 0.
struct FrameTimes {
  double device = 0;    ///< taking over a device, or a part of its memory
  double scene = 0;     ///< choosing nodes
  double drawable = 0;  ///< asking what can be drawn
  double upload = 0;    ///< taking meshes to the device
  double slices = 0;
  double lock = 0;    ///< waiting for a device that makes meshes as well
  double draw = 0;    ///< telling OpenGL what to draw, memory imported for it included
  double finish = 0;  ///< waiting until OpenGL has drawn it
  double tidy = 0;    ///< dropping meshes
};

/// Draws a store: chooses nodes for a view, takes their meshes from the scene to the
/// device, and makes the picture. The same for windows and off-screen. One thread, with
/// the context current that it was made in.
class SceneRenderer {
 public:
  /// Reads the ranges. `on_change` is called from worker threads when a new
  /// picture would show more. `setup`: of the current context, for as long as this picture is
  /// drawn; null: one of its own. Throws what Scene, PictureSetup and DeviceMeshes::use() do.
  SceneRenderer(std::shared_ptr<const StoreReader> store, const PictureBudgets& budgets,
                std::function<void()> on_change, std::shared_ptr<PictureSetup> setup = nullptr);
  ~SceneRenderer();

  const StoreReader& store() const { return *store_; }
  Scene& scene() { return *scene_; }
  Renderer& renderer() { return setup_->renderer(); }
  DeviceMeshes& device() { return *device_; }

  /// The box around the volume, axis by axis of world space.
  WorldBox bounds() const;
  /// The box around what such settings show of it: the blocks of 16³ cells that shown surfaces pass
  /// through, and slices, within cuts and region. bounds() where they show nothing. May read
  /// ranges, and throws what that throws.
  WorldBox shown_bounds(const ViewSettings& settings) const;

  /// Makes the picture in the renderer, of what is there by now, or goes on with it; leaves the one
  /// before until it is whole, and where it would show the same. Throws what Scene, Renderer and
  /// DeviceMeshes do; what had been begun is dropped then.
  void draw(const Camera& camera, int width, int height, const ViewSettings& settings,
            const FrameOptions& options = {});
  const FrameState& state() const { return state_; }
  /// Whether the last draw() finished a picture, rather than to leave the one before.
  bool has_new_frame() const { return has_new_frame_; }
  /// That the last finished picture took to be drawn, in all of its pieces.
  double frame_seconds() const { return frame_seconds_; }
  const FrameCounters& counters() const { return counters_; }
  /// Of the last draw().
  const FrameTimes& times() const { return times_; }

  /// Draws again and again until the picture is complete. Calls `wait` between, which may throw,
  /// some ten times a second.
  void draw_complete(const Camera& camera, int width, int height, const ViewSettings& settings,
                     const std::function<void()>& wait);

 private:
  /// What a picture depends on beside the meshes and slices that there are.
  struct FrameKey {
    Camera camera;
    int width = 0, height = 0;
    ViewSettings settings;  ///< without isovalues: one shows when meshes of it are there
    friend bool operator==(const FrameKey&, const FrameKey&) = default;
  };
  /// What somebody asks to see.
  struct FrameRequest {
    const Camera& camera;
    int width, height;
    const ViewSettings& settings;
    const FrameOptions& options;
    FrameKey key, reduced_key;
    bool idle;  ///< nothing finer than `newest` is to come
    std::shared_ptr<const Drawable> newest;
  };
  /// What a picture shows.
  struct ShownFrame {
    FrameKey key;
    std::shared_ptr<const Drawable> meshes;
    SliceViews::Samples slices;
    std::vector<double> isovalues;  ///< of the meshes
    bool stale = false;  ///< meshes or slices are others by now; these are not kept for that
  };
  /// A picture that has been begun.
  struct PendingFrame {
    ShownFrame frame;
    FrameState state;               ///< what changes with the picture
    std::vector<double> isovalues;  ///< that were request for
    std::uint64_t total_work = 0;   ///< what there was to draw
    double seconds = 0;             ///< that it has taken so far
  };

  void draw_frame(const Camera& camera, int width, int height, const ViewSettings& settings,
                  const FrameOptions& options);
  void update_scene(const Camera& camera, int width, int height, const ViewSettings& settings,
                    const FrameOptions& options);
  /// Takes meshes of the newest drawable to the device; shows it once all are there.
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
  std::future<std::unique_ptr<Scene>> scene_future_;  ///< beside the set-up
  std::shared_ptr<PictureSetup> setup_;
  MeshUploads uploads_;
  SliceViews slices_;
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<DeviceMeshes> device_;
  std::shared_ptr<const Drawable> shown_meshes_, next_meshes_;
  std::vector<std::size_t> shown_surfaces_;  ///< which surface each isovalue of the scene is
  ShownFrame shown_frame_;                   ///< the finished picture
  std::optional<PendingFrame> pending_;      ///< `shown_meshes_` does not change while it is there
  BatchPacer batch_pacer_;
  std::optional<GlFence>
      batch_fence_;  ///< behind the last piece of `pending_`, if it may not be drawn
  std::chrono::steady_clock::time_point finish_time_;  ///< when the last picture was finished
  double frame_seconds_ = 0;
  bool has_new_frame_ = false;
  bool imported_block_ = false;  ///< a piece of a device's memory, in the last draw()
  FrameCounters counters_;
  FrameState state_;
  FrameTimes times_;
};

}  // namespace isobrick

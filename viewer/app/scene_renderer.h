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

#include "viewer/app/clip_region.h"
#include "viewer/app/device_meshes.h"
#include "viewer/app/frame_pacer.h"
#include "viewer/app/mesh_uploads.h"
#include "viewer/app/picture_setup.h"
#include "viewer/app/piece_pacer.h"
#include "viewer/app/slice_views.h"
#include "viewer/app/view_settings.h"
#include "viewer/render/renderer.h"
#include "viewer/scene/scene.h"

namespace isobrick {

/// How long a piece of a picture may take where OpenGL is software: input is answered in between.
inline constexpr double kPieceSeconds = 0.045;

/// What a picture shows and what it still lacks.
struct PictureState {
  /// Nothing finer, nothing else is on its way, and it is no preview.
  bool complete = false;
  bool drawing = false;   ///< a picture has been begun, and the next draw() goes on with it
  double drawn_part = 0;  ///< of that one, 0 … 1
  /// Of each surface that is drawn, by its number: at first, and while the one that was asked
  /// for does not cover the view, not the settings'. NaN: nothing of it is drawn.
  std::vector<double> isovalues;
  bool covers = false;  ///< every surface at its isovalue, without holes, however coarse
  std::uint64_t triangles = 0, nodes = 0;
  bool plain = false;               ///< drawn without occlusion and multisampling to be quick
  bool moving = false;              ///< a preview: drawn as FrameOptions::moving
  std::uint64_t device_bytes = 0;   ///< taken for meshes and slices
  bool more = false;                ///< the next draw() has something to do, whatever comes
  bool limited = false;             ///< by FrameOptions::max_triangles, or by memory
  bool thin = false;                ///< more than FrameOptions::max_triangles, for thin structure
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
  enum class Plain : std::uint8_t { no, until_complete, yes } plain = Plain::no;
  /// A picture that would take longer is drawn in pieces of about so many seconds, one with each
  /// draw(): the same picture, shown when it is whole, dropped when the view changes before. Only
  /// software needs them: a device draws a whole picture in about a frame.
  double piece_seconds = std::numeric_limits<double>::infinity();
  /// The view changes all the time: a picture that has been begun is finished all the same, unless
  /// there are much fewer triangles to draw by now.
  bool moving = false;
  /// Divisor of the width and height that it is shown with. Where it is more than 1, box, axes and
  /// scale bar are drawn there, and as large as always.
  int smaller = 1;
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
struct PictureCounters {
  std::uint64_t finished = 0, dropped = 0;
  std::uint64_t pieces = 0;  ///< after which a picture was not finished yet
};

/// Seconds that the steps of a draw() took this thread; where nothing was drawn, from `turn` to
/// `finish` are 0.
struct PictureTimes {
  double device = 0;    ///< taking over a device, or a part of its memory
  double scene = 0;     ///< choosing nodes
  double drawable = 0;  ///< asking what can be drawn
  double upload = 0;    ///< taking meshes to the device
  double slices = 0;
  double turn = 0;    ///< waiting for a device that makes meshes as well
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
            const FrameOptions& way = {});
  const PictureState& state() const { return state_; }
  /// Whether the last draw() finished a picture, rather than to leave the one before.
  bool drew() const { return drew_; }
  /// That the last finished picture took to be drawn, in all of its pieces.
  double picture_seconds() const { return picture_seconds_; }
  const PictureCounters& counters() const { return counters_; }
  /// Of the last draw().
  const PictureTimes& times() const { return times_; }

  /// Draws again and again until the picture is complete. Calls `wait` between, which may throw,
  /// some ten times a second.
  void draw_complete(const Camera& camera, int width, int height, const ViewSettings& settings,
                     const std::function<void()>& wait);

 private:
  /// What a picture depends on beside the meshes and slices that there are.
  struct Shows {
    Camera camera;
    int width = 0, height = 0;
    ViewSettings settings;  ///< without isovalues: one shows when meshes of it are there
    friend bool operator==(const Shows&, const Shows&) = default;
  };
  /// What somebody asks to see.
  struct Asked {
    const Camera& camera;
    int width, height;
    const ViewSettings& settings;
    const FrameOptions& way;
    Shows shows, shows_plain;
    bool idle;  ///< nothing finer than `newest` is to come
    std::shared_ptr<const Drawable> newest;
  };
  /// What a picture shows.
  struct Pictured {
    Shows shows;
    std::shared_ptr<const Drawable> meshes;
    SliceViews::Samples slices;
    std::vector<double> isovalues;  ///< of the meshes
    bool stale = false;  ///< meshes or slices are others by now; these are not kept for that
  };
  /// A picture that has been begun.
  struct Work {
    Pictured becomes;
    PictureState state;             ///< what changes with the picture
    std::vector<double> isovalues;  ///< that were asked for
    std::uint64_t all = 0;          ///< what there was to draw
    double seconds = 0;             ///< that it has taken so far
  };

  void draw_next(const Camera& camera, int width, int height, const ViewSettings& settings,
                 const FrameOptions& way);
  void update_scene(const Camera& camera, int width, int height, const ViewSettings& settings,
                    const FrameOptions& way);
  /// Takes meshes of the newest drawable to the device; shows it once all are there.
  void upload(const std::shared_ptr<const Drawable>& newest);
  bool can_wait(const Drawable& newest) const;
  bool may_be_plain(const Asked& asked) const;
  std::uint64_t upload_memory() const;
  void drop_unused();
  bool still_wanted(const Work& work, const Asked& asked) const;
  bool shows_all_there_is(const Pictured& next, const Asked& asked) const;
  void choose_picture(const Asked& asked);
  void begin_picture(const Asked& asked);
  void draw_piece(double limit_seconds);
  void wait_drawn(bool everything);
  void finish_picture();
  void drop_picture();
  std::optional<std::size_t> surface_of(const NodeDraw& node, const ViewSettings& settings) const;
  void draw_surfaces(const ViewSettings& settings, const PictureSettings& picture,
                     PictureState& state);
  void update_state(const Asked& asked);

  std::shared_ptr<const StoreReader> store_;
  PictureBudgets budgets_;
  std::future<std::unique_ptr<Scene>> reading_;  ///< beside the set-up
  std::shared_ptr<PictureSetup> setup_;
  MeshUploads uploads_;
  SliceViews slices_;
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<DeviceMeshes> device_;
  std::shared_ptr<const Drawable> shown_, next_;
  std::vector<std::size_t> shown_surfaces_;  ///< which surface each isovalue of the scene is
  Pictured pictured_;                        ///< the finished picture
  std::optional<Work> work_;                 ///< `shown_` does not change while it is there
  PiecePacer pieces_;
  std::optional<GlFence>
      piece_fence_;  ///< behind the last piece of `work_`, if it may not be drawn
  std::chrono::steady_clock::time_point drawn_;  ///< when the last picture was finished
  double picture_seconds_ = 0;
  bool drew_ = false;
  bool imported_ = false;  ///< a piece of a device's memory, in the last draw()
  PictureCounters counters_;
  PictureState state_;
  PictureTimes times_;
};

}  // namespace isobrick

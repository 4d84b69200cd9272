#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <isobrick/open_volume.h>
#include "viewer/app/viewer_state.h"
#include "viewer/render/camera_request.h"

struct GLFWwindow;

namespace isobrick::inline v0 {

/// Options of a window.
struct WindowOptions {
  int width = 1280, height = 800;
  PictureBudgets budgets;
  IndexKind index = IndexKind::linear;  ///< index over active nodes
  CacheOptions cache;                   ///< for stores of files that are dropped
  CameraRequest camera;                 ///< for the first store
  ViewSettings settings;                ///< for the first store
  std::filesystem::path bookmarks;      ///< file; empty: Bookmarks::default_file()
  std::optional<double> batch_seconds;  ///< nullopt: as FrameOptions::in_window()
};

/// A window that shows a store, with mouse, keys, panels and dropped files. All functions are for
/// the thread that made it. One window at a time.
class ViewerWindow {
 public:
  /// Throws Error without a display or OpenGL 4.5.
  explicit ViewerWindow(WindowOptions options);
  ~ViewerWindow();
  ViewerWindow(const ViewerWindow&) = delete;
  ViewerWindow& operator=(const ViewerWindow&) = delete;

  /// Opens a store, or a volume of an image with channels or times; by default the first. `name` is
  /// what people call it, the store's own if empty. Throws what opening throws; the present store
  /// stays then.
  void open(const std::filesystem::path& store, const Selection& selection = {},
            const std::string& name = {});
  /// Opens another volume of the same image. Camera and settings stay, but isovalues outside its
  /// range are replaced. Failures become messages.
  void show_volume(const Selection& selection);
  /// Opens a store, or a file of another format by way of the cache. Computes the ranges of an
  /// image without any first. Failures become messages.
  void drop(const std::filesystem::path& path);

  /// Waits for events and shows the next frame if it may differ. The wait is at most `max_seconds`,
  /// some milliseconds while meshes arrive, and 0 during motion. Returns false once the window is
  /// closed.
  bool step(double max_seconds = 0.1);
  /// Runs until the window is closed or cancellation is requested (core/cancel.h).
  void run();

  ViewerState& state() { return state_; }
  GLFWwindow* handle() { return window_; }

 private:
  class Events;
  /// Position as fractions of the picture's width and height, and the view at that time.
  struct Click {
    double x, y;
    int width, height;
    Camera camera;
    ViewSettings settings;
    bool measuring;
    std::optional<std::size_t> point;  ///< index of the measured point that it set
  };

  /// The visible state besides the picture; a change requires a new frame.
  struct WindowKey {
    std::uint64_t pictures = 0;  ///< frames finished so far
    std::size_t messages = 0;
    bool still = false, histogram = false, converting = false, panels = false, help = false;
    friend bool operator==(const WindowKey&, const WindowKey&) = default;
  };

  void wait(double max_seconds);
  void wait_for_meshes(double max_seconds);
  void draw_picture(int width, int height);
  void draw_frame(bool forced);
  void begin_frame();
  void end_frame();
  void show_notice(const std::string& text);
  void load(const std::filesystem::path& path, const Selection& selection, const std::string& name);
  void show(std::unique_ptr<OpenedVolume> opened, const std::filesystem::path& input,
            const Selection& selection = {});
  bool begin_ranges(const std::filesystem::path& path, const Selection& selection);
  OpenOptions import_options() const;
  void frame_camera(FrameTarget framed);
  void report_empty_surfaces();
  WindowKey window_key() const;
  bool is_due() const;
  PictureArea picture_area() const;
  void pace(double seconds);
  void report_damage();
  bool is_still() const;
  void repeat_clicks();
  void handle_requests();
  void handle_import();
  void look_along(Vec3d direction);
  Click click_at(double x, double y) const;
  std::optional<PickedPoint> pick(const Click& click);
  std::size_t measure(Vec3d world);
  /// In fractions of the window's width and height.
  void click(double x, double y);
  void save_picture(const std::filesystem::path& file);
  bool is_moving() const;
  double still_time() const;
  bool is_minimised() const;
  double aspect() const;

  WindowOptions options_;
  GLFWwindow* window_ = nullptr;
  std::shared_ptr<PictureSetup> setup_;
  std::unique_ptr<Events> events_;
  std::unique_ptr<OpenedVolume> opened_;  ///< keeps the store of a dropped file; may be null
  ViewerState state_;
  double last_time_ = 0;
  double open_time_ = 0;        ///< when the store was opened
  bool surface_shown_ = false;  ///< the store's surface has been shown once
  double last_frame_time_ = 0;  ///< of the last frame
  WindowKey last_frame_key_;    ///< of the last frame
  bool has_event_ = true;       ///< an event since the last step: the next frame may differ
  bool had_event_ = false;      ///< an event before the last step
  bool needs_draw_ = false;     ///< the scene renderer has work
  float scale_ = 1;             ///< of the display
  bool draw_failed_ = false;    ///< the last frame has thrown; the next try waits
  /// Clicks on a preview, whose surface may be coarser. They are repeated on the still frame if the
  /// view is the same.
  std::vector<Click> clicks_;
  std::set<std::string> reported_damage_;  ///< messages of this store
  std::set<double> reported_empty_;        ///< isovalues outside the range of this store
};

}  // namespace isobrick

#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "viewer/app/viewer_state.h"
#include "viewer/render/camera_request.h"

struct GLFWwindow;

namespace isobrick {

/// How a window is opened.
struct WindowOptions {
  int width = 1280, height = 800;
  PictureBudgets budgets;
  IndexKind index = IndexKind::linear;  ///< what finds active nodes
  CameraRequest camera;                 ///< for the first store
  ViewSettings settings;                ///< for the first store
  std::filesystem::path bookmarks;      ///< file; empty: the user's own
  std::optional<double> batch_seconds;  ///< nothing: FrameOptions::in_window()
};

/// A window that shows a store: mouse, keys, panels, files dropped on it. All functions
/// are for the thread that made it; one window at a time.
class ViewerWindow {
 public:
  /// Throws Error when there is no display or no OpenGL 4.5.
  explicit ViewerWindow(WindowOptions options);
  ~ViewerWindow();
  ViewerWindow(const ViewerWindow&) = delete;
  ViewerWindow& operator=(const ViewerWindow&) = delete;

  /// Shows a store, or the chosen volume of an image with channels or times: the first one where
  /// nothing is chosen. Throws what opening it throws; what was shown before stays then.
  void open(const std::filesystem::path& store, const Selection& selection = {});
  /// Shows another volume of the same image; camera and settings stay, but for isovalues that it
  /// does not have. Failures are shown.
  void show_volume(const Selection& selection);
  /// Shows a store, or converts another format and shows that. An image without ranges gets them
  /// first. Failures are shown.
  void drop(const std::filesystem::path& path);

  /// Waits for something to happen, at most so long and not at all while anything moves (some
  /// milliseconds while meshes come in), and shows the next frame if anything has changed. False
  /// once the window is closed.
  bool step(double max_seconds = 0.1);
  /// Until the window is closed, or an end is asked for (core/cancel.h).
  void run();

  ViewerState& state() { return state_; }
  GLFWwindow* handle() { return window_; }

 private:
  class Events;
  /// Parts of the picture's width and height, and what was seen then.
  struct Click {
    double x, y;
    int width, height;
    Camera camera;
    ViewSettings settings;
    bool measuring;
    std::optional<std::size_t> point;  ///< of the measurement, that it made
  };

  /// What is seen beside the picture; another one is a reason for another frame.
  struct WindowKey {
    std::uint64_t pictures = 0;  ///< finished so far
    std::size_t messages = 0;
    bool rests = false, histogram = false, converting = false, panels = false, help = false;
    friend bool operator==(const WindowKey&, const WindowKey&) = default;
  };

  void wait(double max_seconds);
  void wait_for_meshes(double max_seconds);
  void draw_picture(int width, int height);
  void draw_frame(bool asked);
  void begin_frame();
  void end_frame();
  void show_notice(const std::string& text);
  void load(const std::filesystem::path& path, const Selection& selection);
  bool begin_ranges(const std::filesystem::path& path, const Selection& selection);
  ConvertOptions import_options() const;
  void frame_again(FrameTarget framed);
  void report_empty_surfaces();
  WindowKey window_key() const;
  bool is_due() const;
  PictureArea picture_area() const;
  void pace(double seconds);
  void report_damage();
  bool rests() const;
  void settle_clicks();
  void handle_requests();
  void handle_import();
  void look_along(Vec3d direction);
  Click click_at(double x, double y) const;
  std::optional<PickedPoint> pick(const Click& click);
  std::size_t measure(Vec3d world);
  /// At parts of the window's width and height.
  void click(double x, double y);
  void save_picture(const std::filesystem::path& file);
  bool moving() const;
  double settled_at() const;
  bool minimised() const;
  double aspect() const;

  WindowOptions options_;
  GLFWwindow* window_ = nullptr;
  std::shared_ptr<PictureSetup> setup_;
  std::unique_ptr<Events> events_;
  ViewerState state_;
  double last_time_ = 0;
  double open_time_ = 0;        ///< when the store was
  bool surface_shown_ = false;  ///< the store's surface has been shown
  double last_frame_time_ = 0;  ///< when the last frame was
  WindowKey last_frame_key_;    ///< of that frame
  bool has_event_ = true;       ///< something has happened: the next frame may differ from the last
  bool had_event_ = false;      ///< something had happened before the last step
  bool needs_draw_ = false;     ///< the picture would go on by itself
  float scale_ = 1;             ///< of the display: 2 where everything is twice as large
  bool draw_failed_ = false;    ///< the last picture has thrown: it is tried again, but not at once
  /// On a picture that was not at rest, whose surface may be a coarser one: they are looked at
  /// again once the picture rests, if it is still of the same.
  std::vector<Click> clicks_;
  std::set<std::string> reported_damage_;  ///< of this store
  std::set<double> reported_empty_;        ///< isovalues without a surface, of this store
};

}  // namespace isobrick

#include "viewer/app/viewer_window.h"

#include <epoxy/gl.h>
// After OpenGL's header.
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/file_error.h"
#include "core/vectors.h"
#include "viewer/app/framing.h"
#include "viewer/app/panels.h"
#include "viewer/app/pick.h"
#include "viewer/app/screenshot.h"
#include "viewer/app/window_events.h"
#include "viewer/render/font_atlas.h"

namespace isobrick::inline v0 {
namespace {

std::string glfw_message(const char* what) {
  const char* why = nullptr;
  glfwGetError(&why);
  return fmt::format("{}: {}", what, why != nullptr ? why : "for an unknown reason");
}

GLFWwindow* make_window(const WindowOptions& options) {
  if (glfwInit() == GLFW_FALSE)
    throw Error(glfw_message("cannot open a window") +
                " (without a display: --screenshot OUT.png draws into a file)");
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_DEPTH_BITS, 0);  // the renderer has its own buffer
  glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);  // shown with the first notice
  GLFWwindow* window =
      glfwCreateWindow(options.width, options.height, "Isobrick", nullptr, nullptr);
  if (window == nullptr) {
    const std::string message = glfw_message("cannot open a window with OpenGL 4.5");
    glfwTerminate();
    throw Error(message);
  }
  return window;
}

/// Characters of file names and messages: Latin, Greek, Cyrillic, punctuation, arrows, mathematical
/// signs.
constexpr ImWchar kGlyphs[] = {0x20,   0x17f,  0x370,  0x3ff,  0x400,  0x45f,
                               0x2010, 0x2044, 0x20ac, 0x20ac, 0x2190, 0x2195,
                               0x2212, 0x2212, 0x2248, 0x2265, 0};

void load_font(float scale) {
  const std::string_view bytes = font_bytes();
  ImFontConfig config;
  config.FontDataOwnedByAtlas = false;  // so ImGui does not free it
  ImGui::GetIO().Fonts->AddFontFromMemoryTTF(const_cast<char*>(bytes.data()),
                                             static_cast<int>(bytes.size()), kFontPixels * scale,
                                             &config, kGlyphs);
}

/// Initialises Dear ImGui; returns the display's scale.
float set_up_imgui(GLFWwindow* window) {
  ImGui::CreateContext();
  ImGui::GetIO().IniFilename = nullptr;  // no file in the current folder
  ImGui::StyleColorsDark();
  ImGui::GetStyle().WindowRounding = 4;
  float scale = 1, other = 1;
  glfwGetWindowContentScale(window, &scale, &other);
  ImGui::GetStyle().ScaleAllSizes(scale);
  load_font(scale);
  ImGui_ImplGlfw_InitForOpenGL(window, true);
  ImGui_ImplOpenGL3_Init("#version 450");
  return scale;
}

}  // namespace

ViewerWindow::ViewerWindow(WindowOptions options)
    : options_(std::move(options)), window_(make_window(options_)) {
  glfwMakeContextCurrent(window_);
  glfwSwapInterval(1);
  // Installed before ImGui's callbacks, which call these.
  events_ = std::make_unique<Events>(*this);
  scale_ = set_up_imgui(window_);
  state_.panel_width = kPanelWidth * scale_;
  // Compiling shaders takes some time.
  glfwShowWindow(window_);
  show_notice("Starting …");
  PictureSize size;
  glfwGetFramebufferSize(window_, &size.width, &size.height);
  size = {std::max(size.width, 1), std::max(size.height, 1)};
  setup_ = std::make_shared<PictureSetup>(options_.budgets, glfwPostEmptyEvent, size);
  last_time_ = glfwGetTime();
  state_.index = options_.index;
}

ViewerWindow::~ViewerWindow() {
  glfwMakeContextCurrent(window_);
  state_.import.reset();
  state_.isovalue_stats.reset();
  state_.scene_renderer.reset();
  setup_.reset();
  ImGui_ImplOpenGL3_Shutdown();
  ImGui_ImplGlfw_Shutdown();
  ImGui::DestroyContext();
  glfwDestroyWindow(window_);
  glfwTerminate();
}

PictureArea ViewerWindow::picture_area() const {
  int width = 1, height = 1, across = 1, down = 1;
  glfwGetFramebufferSize(window_, &width, &height);
  glfwGetWindowSize(window_, &across, &down);
  const double part =
      static_cast<double>(state_.panel_room(static_cast<float>(across))) / std::max(across, 1);
  const int left = static_cast<int>(std::lround(part * width));
  return {left, std::max(width - left, 1), std::max(height, 1), std::max(width, 1)};
}

double ViewerWindow::aspect() const {
  const PictureArea area = picture_area();
  return static_cast<double>(area.width) / area.height;
}

void ViewerWindow::frame_camera(FrameTarget framed) {
  const SceneRenderer& scene_renderer = *state_.scene_renderer;
  WorldBox box = scene_renderer.bounds();
  try {
    if (framed == FrameTarget::surface) box = scene_renderer.shown_bounds(state_.settings);
  } catch (const std::exception& e) {
    state_.show_message(error_message(e));
  }
  frame(state_.navigator.camera, scene_renderer, box, aspect());
  state_.navigator.stop();
}

void ViewerWindow::look_along(Vec3d direction) {
  Navigator& n = state_.navigator;
  n.stop();
  const double distance = n.camera.distance();
  const bool vertical = std::abs(dot(direction, n.vertical)) > 0.99;
  Camera camera(n.camera.target - direction * distance, n.camera.target,
                vertical ? Vec3d{0, 1, 0} : n.vertical);
  camera.field_of_view = n.camera.field_of_view;
  camera.orthographic = n.camera.orthographic;
  camera.scene = n.camera.scene;
  n.camera = camera;
}

void ViewerWindow::handle_requests() {
  const Requests requests = std::exchange(state_.requests, {});
  if (requests.close) glfwSetWindowShouldClose(window_, GLFW_TRUE);
  if (state_.scene_renderer == nullptr) return;
  if (requests.look_along) look_along(*requests.look_along);
  if (requests.volume) show_volume(*requests.volume);
  if (requests.fit) frame_camera(*requests.fit);
  if (!requests.screenshot) return;
  // A preview may be smaller and have no box and axes, so the still frame is saved.
  if (is_still())
    save_picture(*requests.screenshot);
  else
    state_.requests.screenshot = requests.screenshot;
}

void ViewerWindow::save_picture(const std::filesystem::path& file) {
  try {
    const std::filesystem::path free = free_name(file);
    write_picture(state_.scene_renderer->renderer(), free.string(), false);
    state_.show_message(fmt::format("wrote '{}'", std::filesystem::absolute(free).string()));
  } catch (const std::exception& e) {
    state_.show_message(error_message(e));
  }
}

std::optional<PickedPoint> ViewerWindow::pick(const Click& click) {
  // A preview may be smaller than the window.
  const Renderer& renderer = state_.scene_renderer->renderer();
  return pick_point(*state_.scene_renderer, static_cast<int>(click.x * renderer.width()),
                    static_cast<int>(click.y * renderer.height()));
}

ViewerWindow::Click ViewerWindow::click_at(double x, double y) const {
  Click click{.x = x,
              .y = y,
              .width = 0,
              .height = 0,
              .camera = state_.navigator.camera,
              .settings = state_.settings,
              .measuring = state_.measuring,
              .point = {}};
  const PictureArea area = picture_area();
  click.width = area.width;
  click.height = area.height;
  return click;
}

/// Adds a point to the measurement; returns its index.
std::size_t ViewerWindow::measure(Vec3d world) {
  if (state_.measured.size() == 2) state_.measured.clear();
  state_.measured.push_back(world);
  return state_.measured.size() - 1;
}

void ViewerWindow::click(double x, double y) {
  if (state_.scene_renderer == nullptr) return;
  const PictureArea area = picture_area();
  Click click = click_at((x * area.window_width - area.left) / area.width, y);
  state_.picked = pick(click);
  if (state_.measuring && state_.picked) click.point = measure(state_.picked->world);
  // Earlier clicks belong to a finished measurement, or to none.
  if (!click.measuring || click.point == 0u) clicks_.clear();
  if (!is_still()) clicks_.push_back(std::move(click));
}

/// Whether the picture is the finest possible one.
bool ViewerWindow::is_still() const {
  const FrameState& state = state_.scene_renderer->state();
  return !is_moving() && state.complete && !state.moving;
}

void ViewerWindow::repeat_clicks() {
  if (clicks_.empty()) return;
  const Click now = click_at(0, 0);
  const auto is_outdated = [&](const Click& c) {
    return !(c.camera == now.camera) || !(c.settings == now.settings) || c.width != now.width ||
           c.height != now.height || c.measuring != now.measuring ||
           (c.point && *c.point >= state_.measured.size());
  };
  std::erase_if(clicks_, is_outdated);
  if (clicks_.empty() || !is_still()) return;
  const std::vector<Click> clicks = std::exchange(clicks_, {});
  for (const Click& click : clicks) {
    const auto point = pick(click);
    if (!point) continue;
    state_.picked = point;
    if (click.point)
      state_.measured[*click.point] = point->world;
    else if (click.measuring && (state_.measured.size() < 2 || clicks.size() == 1))
      measure(point->world);  // never ends a measurement of later clicks
  }
}

}  // namespace isobrick

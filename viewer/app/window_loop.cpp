#include "viewer/app/viewer_window.h"

#include <epoxy/gl.h>
// After OpenGL's.
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <utility>

#include "core/cancel.h"
#include "pipeline/value_text.h"
#include "viewer/app/panels.h"
#include "viewer/app/pick.h"
#include "viewer/app/window_events.h"

// What a window does again and again: wait for input, draw, show.

namespace isobrick {
namespace {

/// Above it a frame is no frame but a pause.
constexpr double kLongestStep = 0.1;
/// While meshes come in and nothing moves, from a step that has drawn nothing new to the next one:
/// the cores are for meshes.
constexpr double kNothingNew = 0.008;
/// While a picture is drawn in pieces or meshes come in, and nothing else happens, from one frame
/// to the next: frames would keep software from drawing, and where a display sets the pace a
/// picture of what has come would wait for its turn, after that of a frame that showed nothing new.
constexpr double kLongestUnseen = 0.25;
/// Where nothing happens, from one look at what others have done (a signal, a count) to the next.
constexpr double kIdleStep = 0.25;
/// Messages about damage that are shown one by one.
constexpr std::size_t kMaxReported = 3;
/// Moving pictures may be coarser for so long after the last motion.
constexpr double kSettleSeconds = 0.25;

/// Whether anything but colours differs: those change no mesh, and nobody waits for them.
bool values_differ(ViewSettings a, const ViewSettings& b) {
  a.background_top = b.background_top;
  a.background_bottom = b.background_bottom;
  for (std::size_t i = 0; i < std::min(a.surfaces.size(), b.surfaces.size()); ++i)
    a.surfaces[i].colour = b.surfaces[i].colour;
  return a != b;
}

}  // namespace

/// Says once what cannot be shown.
void ViewerWindow::report_damage() {
  if (const std::string why = state_.facts->take_failure(); !why.empty()) state_.say(why);
  for (const std::string& message : state_.picture->state().damage) {
    if (told_damage_.size() > kMaxReported) return;
    if (!told_damage_.insert(message).second) continue;
    state_.say(told_damage_.size() <= kMaxReported
                   ? message
                   : "more is damaged: 'isobrick verify' names all bricks that cannot be read");
  }
}

/// Says once, of each isovalue that no sample reaches, why nothing of it is seen.
void ViewerWindow::report_empty_surfaces() {
  if (moving()) return;  // one that is dragged goes by
  const ValueRange<double> range = state_.facts->counts().range();
  for (const SurfaceSettings& surface : state_.settings.surfaces) {
    if (!surface.shown || reported_empty_.contains(surface.isovalue)) continue;
    const std::string why =
        why_out_of_range(range, state_.picture->store().info().type, 0, surface.isovalue);
    if (why.empty()) continue;
    reported_empty_.insert(surface.isovalue);
    state_.say(why);
  }
}

double ViewerWindow::settled_at() const {
  return std::max(events_->last_motion(), opened_) + kSettleSeconds;
}

bool ViewerWindow::moving() const {
  return state_.navigator.moving() || glfwGetTime() < settled_at();
}

/// Makes the picture, or goes on with it.
void ViewerWindow::draw_picture(int width, int height) {
  SceneRenderer& picture = *state_.picture;
  const double begin = glfwGetTime();
  // The first picture of a store should not wait for a good one.
  covered_ |= picture.state().covers;
  const bool fluent = moving() || !covered_;
  FrameOptions options = FrameOptions::in_window(state_.pacer, setup_->software(), fluent);
  options.overlay_scale = scale_;
  options.piece_seconds = options_.piece_seconds.value_or(options.piece_seconds);
  const int smaller = fluent ? state_.pacer.smaller() : 1;
  try {
    picture.draw(state_.navigator.camera, std::max(width / smaller, 1),
                 std::max(height / smaller, 1), state_.settings, options);
  } catch (const std::exception& e) {
    if (!std::exchange(failed_, true)) state_.say(e.what());
    return;
  }
  failed_ = false;
  pace(glfwGetTime() - begin);
  report_damage();
  report_empty_surfaces();
  settle_clicks();
}

bool ViewerWindow::minimised() const {
  int width = 0, height = 0;
  glfwGetFramebufferSize(window_, &width, &height);
  return width == 0 || height == 0 || glfwGetWindowAttrib(window_, GLFW_ICONIFIED) == GLFW_TRUE;
}

ViewerWindow::WindowKey ViewerWindow::window_key() const {
  WindowKey key{.messages = state_.messages.size(),
                .converting = state_.import != nullptr,
                .panels = state_.panels,
                .help = state_.help};
  if (state_.picture == nullptr) return key;
  key.pictures = state_.picture->counters().finished;
  key.rests = rests();
  key.histogram = state_.facts->histogram() != nullptr;
  return key;
}

/// Whether what tells how far something is, or a cursor that blinks, needs another frame.
bool ViewerWindow::is_due() const {
  const bool under_way = state_.import != nullptr || ImGui::GetIO().WantTextInput ||
                         (state_.picture != nullptr && !rests());
  return under_way && glfwGetTime() - shown_ >= kLongestUnseen;
}

void ViewerWindow::begin_frame() {
  int width = 0, height = 0;
  glfwGetFramebufferSize(window_, &width, &height);
  glClearColor(0.2f, 0.21f, 0.23f, 1);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glViewport(0, 0, width, height);
  glClear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  events_->hold_tapped_keys();
  ImGui::NewFrame();
}

void ViewerWindow::end_frame() {
  ImGui::Render();
  events_->release_tapped_keys();
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  glfwSwapBuffers(window_);
}

/// A frame with a line of text, before something that takes long.
void ViewerWindow::show_notice(const std::string& text) {
  begin_frame();
  draw_notice(text);
  end_frame();
}

/// Unless it would show nothing new. `asked`: somebody has done something.
void ViewerWindow::draw_frame(bool asked) {
  if (minimised()) return;
  const PictureArea area = picture_area();
  if (state_.picture != nullptr) draw_picture(area.width, area.height);
  const WindowKey key = window_key();
  if (!asked && key == shown_key_ && !is_due()) return;
  shown_key_ = key;
  const double now = glfwGetTime();
  state_.frame_seconds = now - std::exchange(shown_, now);
  state_.frame_times[state_.frame_number++ % state_.frame_times.size()] =
      static_cast<float>(state_.frame_seconds * 1e3);
  begin_frame();
  if (state_.picture != nullptr)
    state_.picture->renderer().copy_to(0, area.width, area.height, area.left);
  const ViewSettings settings = state_.settings;
  const Camera camera = state_.navigator.camera;
  draw_panels(state_);
  // A slider that is dragged, and no click on a widget, is a motion.
  if (ImGui::IsMouseDown(ImGuiMouseButton_Left) && ImGui::IsAnyItemActive() &&
      (values_differ(settings, state_.settings) || camera != state_.navigator.camera))
    events_->moved();
  draw_measure(state_, area);
  end_frame();
}

/// What a picture, or a piece of one, that took this thread so long says of the next one.
void ViewerWindow::pace(double seconds) {
  const SceneRenderer& picture = *state_.picture;
  // There is more to draw; or a better one to come; or something else to do.
  more_ = picture.state().drawing || picture.state().plain || picture.state().more;
  if (!picture.drew()) return;
  state_.draw_seconds = std::max(seconds, picture.picture_seconds());
  if (picture.state().moving)
    state_.pacer.drawn(state_.draw_seconds, picture.state().triangles, picture.state().limited,
                       picture.state().thin);
  else if (!picture.state().plain)
    state_.pacer.drawn_still(state_.draw_seconds, picture.state().triangles);
}

void ViewerWindow::wait(double most_seconds) {
  if (minimised()) return glfwWaitEventsTimeout(most_seconds);
  const bool there = state_.picture != nullptr;
  if (there && moving()) {
    // Until the hand moves on, or holds still for good.
    if (!changed_ && !more_ && !state_.navigator.moving() && !state_.picture->drew())
      return glfwWaitEventsTimeout(std::clamp(settled_at() - glfwGetTime(), kNothingNew,
                                              std::max(most_seconds, kNothingNew)));
    return glfwPollEvents();
  }
  if (!changed_ && !more_ && (!there || state_.picture->state().complete))
    return glfwWaitEventsTimeout(most_seconds);
  const bool before = std::exchange(changed_, false);
  glfwPollEvents();
  wait_for_meshes(most_seconds);
  changed_ |= before;
}

void ViewerWindow::wait_for_meshes(double most_seconds) {
  if (state_.picture == nullptr || state_.picture->drew()) return;
  if (state_.picture->state().drawing || state_.picture->state().more) return;
  // Each mesh that comes in ends a wait, and is not worth a step; the last one is, and what a user
  // does.
  const SceneStream& stream = state_.picture->scene().stream();
  const double end = glfwGetTime() + std::min(kNothingNew, most_seconds);
  for (double now = glfwGetTime(); !changed_ && now < end && (failed_ || !stream.idle());
       now = glfwGetTime())
    glfwWaitEventsTimeout(end - now);
}

bool ViewerWindow::step(double most_seconds) {
  wait(most_seconds);
  if (glfwWindowShouldClose(window_)) return false;
  // What a panel is told by one event it may show with the second frame.
  const bool told = std::exchange(changed_, false), asked = std::exchange(told_, told) || told;
  more_ = false;
  const double now = glfwGetTime();
  const double seconds = now - std::exchange(last_time_, now);
  state_.navigator.update(std::min(seconds, kLongestStep));
  state_.drop_old_messages();
  handle_import();
  handle_requests();
  draw_frame(asked);
  return true;
}

void ViewerWindow::run() {
  while (!cancel_requested() && step(kIdleStep)) {
  }
}

}  // namespace isobrick

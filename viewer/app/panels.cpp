#include "viewer/app/panels.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/format.h>
#include <imgui.h>
#if __has_include(<imgui_stdlib.h>)
#include <imgui_stdlib.h>
#else
#include <misc/cpp/imgui_stdlib.h>
#endif

#include <isobrick/error.h>
#include "core/file_error.h"
#include "core/length_unit.h"
#include "core/stopwatch.h"
#include "core/vectors.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::array<const char*, 3> kAxes{"x", "y", "z"};

void text(const std::string& line) { ImGui::TextUnformatted(line.c_str()); }

std::string mebibytes(std::uint64_t bytes) {
  return fmt::format("{:.0f} MiB", static_cast<double>(bytes) / (1 << 20));
}

/// Parses the whole text as a number.
std::optional<double> number_of(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

/// Edits an isovalue. The text takes effect after Enter, or when the field loses focus.
void type_isovalue(ViewerState& state, std::size_t number) {
  double& isovalue = state.settings.surfaces[number].isovalue;
  const bool is_typing = state.typed && state.typed->surface == number;
  const std::string shown = fmt::format("{:.6g}", isovalue);
  std::string text = is_typing ? state.typed->text : shown;
  if (ImGui::InputText("##isovalue", &text, ImGuiInputTextFlags_CharsScientific))
    state.typed = {number, text};
  if (!state.typed || state.typed->surface != number || ImGui::IsItemActive()) return;
  const std::optional<double> value = number_of(state.typed->text);
  // The text is a rounded value; unchanged text must not change the isovalue.
  if (ImGui::IsItemDeactivated() && value && state.typed->text != shown) isovalue = *value;
  state.typed.reset();
}

void surfaces_panel(ViewerState& state) {
  auto& surfaces = state.settings.surfaces;
  draw_isovalue_slider(state, ImGui::GetContentRegionAvail().x, scaled(90));
  std::optional<std::size_t> removed;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    SurfaceSettings& s = surfaces[i];
    ImGui::PushID(static_cast<int>(i));
    if (ImGui::RadioButton("##selected", state.selected == i)) state.selected = i;
    ImGui::SameLine();
    ImGui::Checkbox("##shown", &s.shown);
    ImGui::SameLine();
    ImGui::ColorEdit3("##colour", &s.colour.x, ImGuiColorEditFlags_NoInputs);
    ImGui::SameLine();
    ImGui::SetNextItemWidth(scaled(90));
    type_isovalue(state, i);
    ImGui::SameLine();
    ImGui::SetNextItemWidth(scaled(70));
    ImGui::SliderFloat("##opacity", &s.opacity, 0.05f, 1, "%.2f", ImGuiSliderFlags_AlwaysClamp);
    ImGui::SameLine();
    if (ImGui::SmallButton("x") && surfaces.size() > 1) removed = i;
    ImGui::PopID();
  }
  if (removed) {
    surfaces.erase(surfaces.begin() + static_cast<std::ptrdiff_t>(*removed));
    state.selected = std::min(state.selected, surfaces.size() - 1);
  }
  if (surfaces.size() < kMaxSurfaces && ImGui::SmallButton("Add a surface")) {
    SurfaceSettings added = surfaces[state.selected];
    added.colour = surface_colour(surfaces.size());
    surfaces.push_back(added);
    state.selected = surfaces.size() - 1;
  }
}

void slices_panel(ViewerState& state) {
  ViewSettings& settings = state.settings;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    SliceSettings& slice = settings.slices[axis];
    ImGui::PushID(kAxes[axis]);
    ImGui::Checkbox(kAxes[axis], &slice.shown);
    ImGui::SameLine();
    ImGui::SetNextItemWidth(scaled(200));
    ImGui::SliderFloat("##place", &slice.position, 0, 1, "%.3f", ImGuiSliderFlags_AlwaysClamp);
    ImGui::PopID();
  }
  const auto range = state.isovalue_stats->counts().range();
  if (range.empty()) return;
  const auto lo = static_cast<float>(range.lo), hi = static_cast<float>(range.hi);
  ImGui::DragFloatRange2("Window", &settings.window_lo, &settings.window_hi, (hi - lo) / 500, lo,
                         hi, "%.5g");
}

/// Draws the choice of the finest stored level.
void finest_level(ViewerState& state) {
  const int coarsest = static_cast<int>(state.scene_renderer->store().info().levels.size()) - 1;
  if (coarsest > 0)
    ImGui::SliderInt("Finest level", &state.settings.finest_level, 0, coarsest, "%d",
                     ImGuiSliderFlags_AlwaysClamp);
}

void look_panel(ViewerState& state) {
  ViewSettings& s = state.settings;
  Navigator& n = state.navigator;
  int mode = static_cast<int>(n.mode);
  ImGui::RadioButton("Orbit", &mode, 0);
  ImGui::SameLine();
  ImGui::RadioButton("Trackball", &mode, 1);
  ImGui::SameLine();
  ImGui::RadioButton("Fly", &mode, 2);
  n.mode = static_cast<NavigationMode>(mode);
  ImGui::Checkbox("Orthographic", &n.camera.orthographic);
  ImGui::SameLine();
  if (ImGui::SmallButton("Fit surface")) state.requests.fit = FrameTarget::surface;
  ImGui::SameLine();
  if (ImGui::SmallButton("Fit volume")) state.requests.fit = FrameTarget::volume;
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {1.0, -1.0}) {
      if (axis + (sign < 0) > 0) ImGui::SameLine();
      if (!ImGui::SmallButton(
              fmt::format("{}{}", sign > 0 ? '+' : '-', kAxes[static_cast<std::size_t>(axis)])
                  .c_str()))
        continue;
      Vec3d along;
      along[axis] = -sign;
      state.requests.look_along = along;
    }
  auto angle = static_cast<float>(n.camera.field_of_view);
  if (ImGui::SliderFloat("Field of view", &angle, 5, 100, "%.0f\u00b0",
                         ImGuiSliderFlags_AlwaysClamp))
    n.camera.field_of_view = angle;
  finest_level(state);
  ImGui::SliderFloat("Cell, pixels", &s.pixel_error, 0.5f, 8, "%.1f", ImGuiSliderFlags_AlwaysClamp);
  ImGui::Checkbox("Occlusion", &s.occlusion);
  ImGui::SameLine();
  ImGui::Checkbox("Edges", &s.edges);
  ImGui::SameLine();
  ImGui::Checkbox("Smooth", &s.multisample);
  ImGui::Checkbox("Box", &s.box);
  ImGui::SameLine();
  ImGui::Checkbox("Axes", &s.axes);
  ImGui::SameLine();
  ImGui::Checkbox("Scale bar", &s.scale_bar);
  ImGui::ColorEdit3("Above", &s.background_top.x, ImGuiColorEditFlags_NoInputs);
  ImGui::SameLine();
  ImGui::ColorEdit3("Below", &s.background_bottom.x, ImGuiColorEditFlags_NoInputs);
}

void picking_panel(ViewerState& state) {
  const std::string unit =
      unit_symbol(state.scene_renderer->scene().tree().grid().transform().unit);
  if (const auto& p = state.picked) {
    text(fmt::format("Position {:.6g}, {:.6g}, {:.6g} {}", p->world.x, p->world.y, p->world.z,
                     unit));
    text(fmt::format("Sample {:.2f}, {:.2f}, {:.2f}", p->index.x, p->index.y, p->index.z));
    if (p->value) text(fmt::format("Value {:.6g}", *p->value));
    if (p->normal)
      text(fmt::format("Normal {:.3f}, {:.3f}, {:.3f}", p->normal->x, p->normal->y, p->normal->z));
  } else {
    ImGui::TextDisabled("Click on a surface.");
  }
  if (ImGui::Checkbox("Measure a distance", &state.measuring)) state.measured.clear();
  if (state.measured.size() == 2)
    text(fmt::format("Distance {:.6g} {}", length(state.measured[1] - state.measured[0]), unit));
  else if (state.measuring)
    ImGui::TextDisabled(state.measured.empty() ? "Click on its first end."
                                               : "Click on its other end.");
}

/// Calls f() and shows an exception as a message.
template <class F>
void attempt(ViewerState& state, F&& f) {
  try {
    f();
  } catch (const std::exception& e) {
    state.show_message(error_message(e));
  }
}

void bookmarks_panel(ViewerState& state) {
  if (state.bookmarks == nullptr) return;
  const auto& list = state.bookmarks->list();
  std::optional<std::size_t> removed;
  for (std::size_t i = 0; i < list.size(); ++i) {
    ImGui::PushID(static_cast<int>(i));
    if (ImGui::Selectable(list[i].name.c_str(), false, 0,
                          {ImGui::GetContentRegionAvail().x - scaled(40), 0})) {
      const WorldBall scene = state.navigator.camera.scene;
      state.navigator.stop();
      state.navigator.camera = list[i].camera;
      state.navigator.camera.scene = scene;
      state.settings = list[i].settings;
      state.selected = 0;
    }
    ImGui::SameLine();
    if (ImGui::SmallButton("x")) removed = i;
    ImGui::PopID();
  }
  if (removed) attempt(state, [&] { state.bookmarks->remove(*removed); });
  std::string& name = state.new_bookmark;
  ImGui::SetNextItemWidth(scaled(180));
  ImGui::InputText("##name", &name);
  ImGui::SameLine();
  if (ImGui::SmallButton("Keep this view") && !name.empty())
    attempt(state, [&] {
      state.bookmarks->add({name, state.navigator.camera, state.settings});
      name.clear();
    });
}

/// Counts a few times a second, since that takes as long as planning.
std::uint64_t missing_bricks(ViewerState& state) {
  constexpr double kSeconds = 0.25;
  // If there are many, counting takes at most a fiftieth of the time.
  constexpr double kPart = 50;
  const double now = ImGui::GetTime();
  if (now >= state.next_brick_count) {
    Stopwatch watch;
    state.missing_bricks = state.scene_renderer->scene().stream().missing_bricks();
    state.next_brick_count = now + std::max(kSeconds, kPart * watch.lap());
  }
  return state.missing_bricks;
}

/// Describes the state of a frame.
const char* stage_of(const FrameState& p) {
  if (p.moving) return "preview";
  return p.complete && !p.reduced_quality ? "complete" : "refining";
}

void status_panel(ViewerState& state) {
  const StreamCounters c = state.scene_renderer->scene().stream().counters();
  const FrameState& p = state.scene_renderer->state();
  ImGui::PlotLines("##frames", state.frame_times.data(), static_cast<int>(state.frame_times.size()),
                   static_cast<int>(state.frame_number % state.frame_times.size()), nullptr, 0, 50,
                   {ImGui::GetContentRegionAvail().x, scaled(36)});
  text(fmt::format("{:.0f} frames/s, drawn in {:.1f} ms",
                   state.frame_seconds > 0 ? 1 / state.frame_seconds : 0,
                   state.draw_seconds * 1e3));
  if (p.moving && p.limited)
    text(fmt::format("preview: about {} triangles, 1/{} of the size", state.pacer.max_triangles(),
                     state.pacer.size_divisor()));
  text(fmt::format("{} triangles in {} parts, {} on the device", p.triangles, p.nodes,
                   mebibytes(p.device_bytes)));
  text(fmt::format("bricks: {} resident ({}), {} to read", c.bricks_resident,
                   mebibytes(c.brick_bytes), missing_bricks(state)));
  text(fmt::format("read {} in {:.2f} s, decode {:.2f} s, mesh {:.2f} s", mebibytes(c.bytes_read),
                   c.read_seconds, c.decode_seconds, c.mesh_seconds));
  text(fmt::format("{} meshes ({}), {} waiting, {} in progress", c.meshes, mebibytes(c.mesh_bytes),
                   c.queue, c.working));
  if (p.limited_by_budget) text("detail limited by the memory budget");
  if (!p.damage.empty()) text(fmt::format("{} parts cannot be shown", p.damage.size()));
  if (p.drawing)
    ImGui::TextDisabled("drawing %.0f %%", 100 * p.drawn_fraction);
  else
    ImGui::TextDisabled("%s", stage_of(p));
}

void import_progress(ImportJob& import) {
  const ImportJob::State s = import.state();
  text(fmt::format("{}{}", import.input().string(),
                   import.volume() ? "\nranges of its samples" : ""));
  const float part = s.total > 0 ? static_cast<float>(s.done) / static_cast<float>(s.total) : 0;
  ImGui::ProgressBar(std::min(part, 1.f), {scaled(400), 0}, s.stage.c_str());
  if (ImGui::Button("Cancel")) import.cancel();
}

void import_panel(ViewerState& state) {
  if (state.import != nullptr) ImGui::OpenPopup("Converting");
  if (!ImGui::BeginPopupModal("Converting", nullptr, ImGuiWindowFlags_AlwaysAutoResize)) return;
  if (state.import == nullptr)
    ImGui::CloseCurrentPopup();
  else
    import_progress(*state.import);
  ImGui::EndPopup();
}

void messages_panel(ViewerState& state) {
  if (state.messages.empty()) {
    state.messages_shown = 0;
    return;
  }
  // Beside the panel if there is room, and always in front of it.
  const ImVec2 all = ImGui::GetMainViewport()->Size;
  const float taken = state.panel_room(all.x);
  const float width = 0.9f * (all.x - taken);
  ImGui::SetNextWindowPos({(all.x + taken) / 2, all.y - 20}, ImGuiCond_Always, {0.5f, 1});
  ImGui::SetNextWindowSizeConstraints({std::min(scaled(300), width), 0}, {width, all.y * 0.4f});
  // A new message comes to the front, but takes no field's or slider's focus.
  const bool busy = ImGui::IsAnyItemActive() || ImGui::GetIO().WantTextInput;
  if (!busy && std::exchange(state.messages_shown, state.messages.size()) != state.messages.size())
    ImGui::SetNextWindowFocus();
  ImGui::Begin("Messages", nullptr,
               ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_AlwaysAutoResize |
                   ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing);
  ImGui::PushTextWrapPos(width - scaled(20));
  for (const Message& message : state.messages) text(message.text);
  ImGui::PopTextWrapPos();
  // Messages under the pointer stay.
  if (ImGui::IsWindowHovered())
    for (Message& message : state.messages)
      message.until = std::chrono::steady_clock::now() + state.message_time;
  if (ImGui::Button("Dismiss")) state.messages.clear();
  ImGui::End();
}

void streaming_panel(ViewerState& state) {
  draw_search_panel(state);
  draw_backend_panel(state);
  status_panel(state);
}

/// Draws a section; widgets of different sections may have equal names.
template <class Body>
void section(const char* name, bool open, Body&& body, ViewerState& state) {
  if (!ImGui::CollapsingHeader(name, open ? ImGuiTreeNodeFlags_DefaultOpen : 0)) return;
  ImGui::PushID(name);
  body(state);
  ImGui::PopID();
}

/// Along the left side of the window, beside the picture.
void main_panel(ViewerState& state) {
  const ImVec2 all = ImGui::GetMainViewport()->Size;
  const float least = scaled(250);
  ImGui::SetNextWindowPos({0, 0}, ImGuiCond_Always);
  ImGui::SetNextWindowSize({scaled(kPanelWidth), all.y}, ImGuiCond_FirstUseEver);
  ImGui::SetNextWindowSizeConstraints({least, all.y}, {std::max(least, all.x * 0.6f), all.y});
  ImGui::Begin(fmt::format("{}###panel", state.name).c_str(), nullptr,
               ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoCollapse);
  state.panel_width = ImGui::GetWindowWidth();
  draw_volumes_panel(state);
  section("Surfaces", true, surfaces_panel, state);
  section("Camera and look", false, look_panel, state);
  section("Clipping and region", false, draw_clip_panel, state);
  section("Slices", false, slices_panel, state);
  section("Point and measure", false, picking_panel, state);
  section("Bookmarks", false, bookmarks_panel, state);
  section("Streaming", true, streaming_panel, state);
  if (ImGui::SmallButton("Picture")) state.requests.screenshot = "isobrick.png";
  ImGui::SameLine();
  if (ImGui::SmallButton("Help (F1)")) state.help = !state.help;
  ImGui::End();
}

}  // namespace

float scaled(float pixels) { return pixels * ImGui::GetFontSize() / kFontPixels; }

void draw_notice(const std::string& text) {
  const ImVec2 all = ImGui::GetMainViewport()->Size;
  ImGui::SetNextWindowPos({all.x / 2, all.y / 2}, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::Begin("Isobrick", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize |
                   ImGuiWindowFlags_NoSavedSettings);
  ImGui::TextUnformatted(text.c_str());
  ImGui::End();
}

void draw_panels(ViewerState& state) {
  messages_panel(state);
  if (state.scene_renderer == nullptr)
    draw_notice(
        "Drop a store, or a volume of any format, on this window.\nF1 shows keys and mouse.");
  else if (state.panels)
    main_panel(state);
  draw_help(state);
  // ImGui 1.86 fails an assertion for a new window after a new modal one, and for a window that
  // appears while an open modal one is no longer drawn.
  import_panel(state);
}

}  // namespace isobrick

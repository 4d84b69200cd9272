#include "viewer/app/viewer_window.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <limits>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "bricks/storage/open_storage.h"
#include "bricks/zarr/metadata_files.h"
#include "core/file_error.h"
#include "pipeline/index/add_ranges.h"
#include "viewer/app/framing.h"
#include "viewer/render/gl_context.h"

// The volume of a window: opened, dropped, converted, chosen from an image.

namespace isobrick::inline v0 {
namespace {

/// Whether the shown volume of a Zarr lacks ranges.
bool lacks_ranges(const std::filesystem::path& path, const Selection& selection) {
  return !has_all_ranges(StoreReader(path, image_volumes(path, selection).selection));
}

}  // namespace

/// Replaces the volume; the settings stay.
void ViewerWindow::load(const std::filesystem::path& path, const Selection& selection,
                        const std::string& name) {
  ImageVolumes volumes = image_volumes(path, selection);
  auto store = std::make_shared<const StoreReader>(path, volumes.selection);
  auto stats = std::make_unique<IsovalueStats>(store);
  // Last: making it drops the previous store's picture from the renderer.
  auto renderer =
      std::make_unique<SceneRenderer>(store, options_.budgets, glfwPostEmptyEvent, setup_);
  renderer->scene().search().use(state_.index);
  state_.isovalue_stats = std::move(stats);
  state_.scene_renderer = std::move(renderer);
  state_.path = path;
  state_.name = name;
  state_.volumes = std::move(volumes);
  state_.pacer = FramePacer::for_device(current_gl_device().software);
  open_time_ = glfwGetTime();
  surface_shown_ = false;
  state_.picked.reset();
  state_.measured.clear();
  clicks_.clear();
  state_.typed.reset();
  reported_damage_.clear();
  reported_empty_.clear();
  const std::string volume = text_of(state_.volumes);
  glfwSetWindowTitle(
      window_, fmt::format("{}{}{} - Isobrick", name, volume.empty() ? "" : ", ", volume).c_str());
  has_event_ = true;
}

void ViewerWindow::open(const std::filesystem::path& path, const Selection& selection,
                        const std::string& name) {
  const std::string shown = name.empty() ? path.filename().string() : name;
  if (state_.scene_renderer == nullptr) show_notice(fmt::format("Opening '{}' …", shown));
  load(path, selection, shown);
  state_.selected = 0;
  state_.settings = options_.settings;
  // In software four samples per pixel take more time than anything else.
  if (current_gl_device().software) state_.settings.multisample = false;
  choose_values(state_.settings, state_.scene_renderer->scene().tree());
  state_.navigator.stop();
  state_.navigator.vertical = options_.camera.up;
  state_.navigator.camera =
      make_camera(options_.camera, *state_.scene_renderer, state_.settings, aspect());
  state_.bookmarks.reset();
  try {
    state_.bookmarks = std::make_unique<Bookmarks>(
        options_.bookmarks.empty() ? Bookmarks::default_file() : options_.bookmarks, path);
  } catch (const std::exception& e) {
    state_.show_message(error_message(e));
  }
  // The next store is framed anew, with an isovalue of its own.
  options_.camera = {};
  options_.settings.surfaces.clear();
  options_.settings.region_on = false;
  options_.settings.finest_level = 0;
}

void ViewerWindow::show_volume(const Selection& selection) {
  try {
    if (begin_ranges(state_.path, selection)) return;
    load(state_.path, selection, state_.name);
    ViewSettings& settings = state_.settings;
    const ValueRange<double> range = state_.isovalue_stats->counts().range();
    for (SurfaceSettings& surface : settings.surfaces)
      if (!range.stabbed_by(surface.isovalue))
        surface.isovalue = std::numeric_limits<double>::quiet_NaN();
    if (settings.window_hi <= range.lo || settings.window_lo >= range.hi)
      settings.window_lo = settings.window_hi = 0;
    choose_values(settings, state_.scene_renderer->scene().tree());
  } catch (const std::exception& e) {
    state_.show_message(error_message(e));
  }
}

OpenOptions ViewerWindow::import_options() const {
  if (state_.import != nullptr) throw Error("another file is being converted");
  OpenOptions options;
  options.cache = options_.cache;
  options.memory = options_.budgets.memory;
  options.threads = options_.budgets.threads;
  return options;
}

/// Starts to compute the ranges that a volume lacks; returns false if it lacks none.
bool ViewerWindow::begin_ranges(const std::filesystem::path& path, const Selection& selection) {
  if (!lacks_ranges(path, selection)) return false;
  const Selection shown = image_volumes(path, selection).selection;
  state_.import = std::make_unique<ImportJob>(path, shown, import_options());
  return true;
}

/// Opens a file that was dropped; `opened` is its store, null of what is a store itself.
void ViewerWindow::show(std::unique_ptr<OpenedVolume> opened, const std::filesystem::path& input,
                        const Selection& selection) {
  if (opened != nullptr)
    open(opened->store().storage()->local_path(), opened->store().info().selection,
         input.filename().string());
  else
    open(input, selection);
  opened_ = std::move(opened);
}

void ViewerWindow::drop(const std::filesystem::path& path) {
  try {
    // A zip cannot be added to.
    if (!is_zarr(path) || (is_zip(path) && lacks_ranges(path, {})))
      state_.import = std::make_unique<ImportJob>(path, import_options());
    else if (!begin_ranges(path, {}))
      show({}, path);
  } catch (const std::exception& e) {
    state_.show_message(error_message(e));
  }
}

void ViewerWindow::handle_import() {
  if (state_.import == nullptr) return;
  const ImportJob::State now = state_.import->state();
  if (!now.finished) return;
  const std::filesystem::path input = state_.import->input();
  const std::optional<Selection> volume = state_.import->volume();
  std::unique_ptr<OpenedVolume> opened = state_.import->take();
  state_.import.reset();
  if (now.cancelled) return;
  if (!now.failure.empty()) return state_.show_message(now.failure);
  try {
    if (volume && input == state_.path)
      show_volume(*volume);
    else
      show(std::move(opened), input, volume.value_or(Selection()));
  } catch (const std::exception& e) {
    state_.show_message(error_message(e));
  }
  for (const std::string& note : now.notes) state_.show_message(note);
}

}  // namespace isobrick

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "bricks/image_volumes.h"
#include "bricks/zarr/metadata_files.h"
#include "io/bytes/output_file.h"
#include "io/bytes/output_guard.h"
#include "io/volumes/open/volume_format.h"
#include "tools/format.h"
#include "tools/input.h"
#include "tools/interrupt.h"
#include "tools/isovalues.h"
#include "tools/output_name.h"
#include "tools/picture_options.h"
#include "tools/store_region.h"
#include "tools/value_range.h"
#include "tools/view_memory.h"
#include "viewer/app/framing.h"
#include "viewer/app/screenshot.h"
#include "viewer/app/viewer_window.h"
#include "viewer/render/camera_request.h"
#include "viewer/render/gl_context.h"

namespace isobrick::tools {
namespace {

struct ViewArguments {
  InputArguments input;
  std::string screenshot, turntable;
  std::vector<IsovalueRequest> isovalues;
  PictureOptions picture{.size = {1280, 800}};
  ViewSettings settings;
  int frames = 120;
  bool plain = false, force = false;
  int level = 0;
  RegionArguments region;
  PictureBudgets budgets;
  IndexChoice search;

  /// Without a stored index the viewer builds one only where it is named.
  IndexKind index() const { return search.kind.value_or(IndexKind::linear); }
};

/// Cuts the shown region along an axis to what lies between two places among level 0's samples.
void cut(ViewSettings& settings, int axis, double lo, double hi, double last) {
  if (!(last > 0)) return;
  settings.region_lo[axis] =
      std::max(settings.region_lo[axis], static_cast<float>(std::clamp(lo / last, 0.0, 1.0)));
  settings.region_hi[axis] =
      std::min(settings.region_hi[axis], static_cast<float>(std::clamp(hi / last, 0.0, 1.0)));
}

/// Shows only --roi, which counts the samples of --level.
void cut_to_roi(const StoreReader& store, int level, const RoiText& roi, ViewSettings& settings) {
  const StoreInfo& info = store.info();
  const LevelInfo& of_level = info.levels[static_cast<std::size_t>(level)];
  const Box3 box = resolve_region(roi, of_level.lattice.extent);
  const Vec3d last = last_sample(store);
  const auto place = [&](int axis, Index sample) {
    Vec3d index;
    index[axis] = static_cast<double>(sample);
    return info.levels.front().transform.index_of(of_level.transform.apply(index))[axis];
  };
  for (int axis = 0; axis < 3; ++axis)
    // The outermost samples of a coarse level lie within the volume, which is shown up to its end.
    cut(settings, axis, box.lo[axis] > 0 ? place(axis, box.lo[axis]) : 0,
        box.hi[axis] < of_level.lattice.extent[axis] ? place(axis, box.hi[axis] - 1) : last[axis],
        last[axis]);
}

/// Shows only --region, a box of the world; of a volume whose axes are turned the box around it.
void cut_to_region(const StoreReader& store, const WorldRegion& region, ViewSettings& settings) {
  const Transform& finest = store.info().levels.front().transform;
  const Vec3d last = last_sample(store);
  const auto [lo, hi] = index_bounds(region, finest);
  for (int axis = 0; axis < 3; ++axis) cut(settings, axis, lo[axis], hi[axis], last[axis]);
}

/// Shows only the requested region, and no finer level than --level.
void set_region(const StoreReader& store, const ViewArguments& arguments, ViewSettings& settings) {
  store_region(store, arguments.level, arguments.region);  // refuses what is not there
  settings.finest_level = arguments.level;
  const auto& [roi, region] = arguments.region;
  settings.region_on = roi || region;
  if (roi) cut_to_roi(store, arguments.level, *roi, settings);
  if (region) cut_to_region(store, *region, settings);
}

/// The isovalues that are requested or, if none is, one to begin with.
std::vector<double> isovalues_of(const ViewArguments& arguments, const StoreReader& store,
                                 Console& console) {
  if (!arguments.isovalues.empty()) return resolve_isovalues(arguments.isovalues, store, console);
  const auto suggested = suggest_isovalue_of(store, console);
  return suggested ? std::vector{suggested->value} : std::vector<double>{};
}

ViewSettings settings_of(const ViewArguments& arguments, const std::vector<double>& isovalues) {
  ViewSettings settings = arguments.settings;
  const std::size_t count = std::max<std::size_t>(isovalues.size(), 1);
  for (const MeshStyle& style : styles_of(arguments.picture, count, "isovalues")) {
    const std::size_t i = settings.surfaces.size();
    SurfaceSettings surface{.colour = style.colour, .opacity = style.opacity};
    if (i < isovalues.size()) surface.isovalue = isovalues[i];
    settings.surfaces.push_back(surface);
  }
  for (const HalfSpace& half : arguments.picture.planes) settings.planes.push_back({true, half});
  settings.edges = arguments.picture.edges;
  settings.occlusion = !arguments.picture.no_occlusion;
  if (arguments.plain) settings.box = settings.axes = settings.scale_bar = false;
  return settings;
}

nlohmann::ordered_json to_json(const NodeSearch::State& search) {
  return {{"kind", name_of(search.kind)},          {"bytes", search.bytes},
          {"build_seconds", search.build_seconds}, {"search_seconds", search.search_seconds},
          {"active_nodes", search.active},         {"nodes", search.nodes}};
}

void make_folder(const std::string& folder) {
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure) throw system_error("create the folder", folder, failure.value());
}

/// Moves the cameras of a turn so far back that all of them see the box whole.
void see_whole(std::vector<Screenshot>& turn, const WorldBox& box, double aspect) {
  const auto fitting = [&](Camera camera) {
    camera.fit(box.lo, box.hi, aspect);
    return camera.distance();
  };
  double most = 0;
  for (const Screenshot& shot : turn) most = std::max(most, fitting(shot.camera));
  const double first = fitting(turn.front().camera);
  for (Screenshot& shot : turn) shot.camera.zoom(first / most);
}

/// The requested pictures, of which none may be there already.
std::vector<Screenshot> shots_of(const ViewArguments& arguments, const SceneRenderer& picture,
                                 const ViewSettings& settings) {
  if (!arguments.screenshot.empty()) check_picture_name(arguments.screenshot);
  const CameraRequest& request = arguments.picture.camera;
  const double aspect =
      static_cast<double>(arguments.picture.size.width) / arguments.picture.size.height;
  const Camera camera = make_camera(request, picture, settings, aspect);
  std::vector<Screenshot> shots;
  if (!arguments.turntable.empty()) {
    make_folder(arguments.turntable);
    shots = turntable(camera, request.up, arguments.frames, arguments.turntable);
    if (!request.eye) see_whole(shots, picture.shown_bounds(settings), aspect);
  }
  if (!arguments.screenshot.empty()) shots.insert(shots.begin(), {arguments.screenshot, camera});
  const std::array<std::filesystem::path, 1> inputs{arguments.input.path};
  for (const Screenshot& shot : shots) {
    check_replaces_no_input(shot.file, inputs);
    check_output(shot.file, arguments.force);
  }
  // Also shows that there is such a folder, and that it can be written to.
  for (const Screenshot* shot : {&shots.front(), &shots.back()})
    OutputFile(shot->file, arguments.force);
  return shots;
}

/// What all pictures have come to.
struct ScreenshotReport {
  std::set<std::string> damage;
  std::uint64_t most_triangles = 0;
  bool limited_by_budget = false;
};

ScreenshotReport draw_shots(SceneRenderer& picture, const std::vector<Screenshot>& shots,
                            PictureSize size, const ViewSettings& settings, bool force,
                            Progress& progress) {
  ScreenshotReport drawn;
  progress.begin("draw", 0);
  for (const Screenshot& shot : shots) {
    picture.draw_complete(shot.camera, size.width, size.height, settings,
                          [&] { progress.advance(0); });
    write_picture(picture.renderer(), shot.file, force);
    const FrameState& state = picture.state();
    drawn.damage.insert(state.damage.begin(), state.damage.end());
    drawn.most_triangles = std::max(drawn.most_triangles, state.triangles);
    drawn.limited_by_budget |= state.limited_by_budget;
  }
  progress.end();
  return drawn;
}

/// Draws into files.
int draw(const ViewArguments& arguments, Console& console) {
  if (is_standard_output(arguments.screenshot)) console.reserve_output();
  const OpenedVolume input =
      open_input(arguments.input, arguments.budgets.memory, arguments.budgets.threads, console);
  const auto store =
      std::make_shared<const StoreReader>(input.store().storage(), input.store().info().selection);
  const std::vector<double> isovalues = isovalues_of(arguments, *store, console);
  const std::vector<MeshStyle> styles =
      styles_of(arguments.picture, std::max<std::size_t>(isovalues.size(), 1), "isovalues");
  const bool transparent = std::any_of(styles.begin(), styles.end(),
                                       [](const MeshStyle& style) { return style.opacity < 1; });
  ViewSettings settings = settings_of(arguments, isovalues);
  set_region(*store, arguments, settings);
  const GlContext context;
  SceneRenderer picture(store,
                        divide_view_memory(arguments.budgets, *store, arguments.picture.size,
                                           transparent, current_gl_device().software),
                        {});
  choose_values(settings, picture.scene().tree());
  const std::vector<Screenshot> shots = shots_of(arguments, picture, settings);
  NodeSearch& search = picture.scene().search();
  search.use(arguments.index());
  search.wait();
  if (const std::string refused = search.state().refused; !refused.empty())
    console.note(refused + ": a linear scan is used");
  const ScreenshotReport drawn = draw_shots(picture, shots, arguments.picture.size, settings,
                                            arguments.force, console.progress());
  for (const std::string& message : drawn.damage) console.note(message);
  for (const SurfaceSettings& surface : settings.surfaces)
    if (const std::string why = why_out_of_range(*store, arguments.level, surface.isovalue);
        !why.empty())
      console.note(why);
  if (drawn.limited_by_budget)
    console.note(
        "the picture is coarser than --pixel-error allows: there is no room for more triangles; a "
        "larger --memory or --gpu-memory makes it finer");
  nlohmann::ordered_json shown = nlohmann::ordered_json::array();
  for (const SurfaceSettings& surface : settings.surfaces) shown.push_back(surface.isovalue);
  const std::string text =
      fmt::format("{} triangles{}, drawn by {}\n", human_count(drawn.most_triangles),
                  shots.size() > 1 ? " at most" : "", current_gl_device().renderer);
  std::string outputs = arguments.screenshot;
  if (!arguments.turntable.empty())
    outputs += fmt::format("{}{} pictures in {}", outputs.empty() ? "" : ", ", arguments.frames,
                           arguments.turntable);
  console.result({{"command", "view"},
                  {"input", arguments.input.path},
                  {"level", arguments.level},
                  {"isovalues", shown},
                  {"screenshot", arguments.screenshot},
                  {"turntable", arguments.turntable},
                  {"pictures", shots.size()},
                  {"width", arguments.picture.size.width},
                  {"height", arguments.picture.size.height},
                  {"most_triangles", drawn.most_triangles},
                  {"index", to_json(search.state())},
                  {"damaged_parts", drawn.damage.size()},
                  {"limited_by_budget", drawn.limited_by_budget},
                  {"meshes_by", picture.device().describe()},
                  {"renderer", current_gl_device().renderer},
                  {"peak_resident_bytes", peak_resident_bytes()}},
                 fmt::format("{}: {}", outputs, text));
  return drawn.damage.empty() ? 0 : 1;
}

/// What of an image the window shows first: of several channels or times the first.
OpenedVolume open_shown(const ViewArguments& arguments, Console& console) {
  InputArguments input = arguments.input;
  if (is_zarr(input.path))
    input.volume.selection = image_volumes(input.path, input.volume.selection).selection;
  // The window computes ranges that are missing, where they can be added.
  return open_input(input, arguments.budgets.memory, arguments.budgets.threads, console,
                    !std::filesystem::is_directory(input.path));
}

int run_view(const ViewArguments& arguments, Console& console) {
  if (!arguments.screenshot.empty() || !arguments.turntable.empty()) {
    if (arguments.input.path.empty())
      throw UsageError("INPUT is required to draw into files; see 'isobrick view --help'");
    return draw(arguments, console);
  }
  WindowOptions options;
  options.width = arguments.picture.size.width;
  options.height = arguments.picture.size.height;
  options.budgets = arguments.budgets;
  options.index = arguments.index();
  options.cache = arguments.input.cache;
  options.camera = arguments.picture.camera;
  // An input that cannot be opened is reported before anything about windows.
  std::optional<OpenedVolume> input;
  if (!arguments.input.path.empty()) {
    input.emplace(open_shown(arguments, console));
    options.settings = settings_of(arguments, isovalues_of(arguments, input->store(), console));
    set_region(input->store(), arguments, options.settings);
  } else {
    options.settings = settings_of(arguments, {});
  }
  set_interrupt_note([] { return "the window is closed"; });
  {
    ViewerWindow window(options);
    if (input) {
      const StoreInfo& info = input->store().info();
      const std::filesystem::path store = input->store().storage()->local_path();
      window.open(
          store, store == arguments.input.path ? arguments.input.volume.selection : info.selection,
          std::filesystem::path(split_volume_path(arguments.input.path).file).filename().string());
    }
    window.run();
  }  // a conversion that still ran has left nothing
  if (const int signal = interrupting_signal(); signal != 0) throw Interrupted(signal);
  console.result({{"command", "view"},
                  {"input", arguments.input.path},
                  {"peak_resident_bytes", peak_resident_bytes()}},
                 "");
  return 0;
}

float parse_pixel_error(const std::string& text) {
  const auto pixels = static_cast<float>(parse_number(text));
  if (!(pixels >= kMinPixelError && pixels <= kMaxPixelError))
    throw UsageError(fmt::format("'{}' is no pixel error; it lies within {} and {}", text,
                                 kMinPixelError, kMaxPixelError));
  return pixels;
}

/// "x:PART": a slice across an axis, its place in parts of the volume.
void parse_slice(const std::string& text, ViewSettings& settings) {
  const auto axis = std::string_view("xyz").find(text.empty() ? '?' : text[0]);
  const double place = text.size() > 2 && text[1] == ':' ? parse_number(text.substr(2)) : -1;
  if (axis == std::string_view::npos || !(place >= 0 && place <= 1))
    throw UsageError(
        fmt::format("'{}' is no slice; one is x:0.5 or y:… or z:…, within 0 and 1", text));
  settings.slices[axis] = {true, static_cast<float>(place)};
}

void add_what_to_draw(CLI::App* app, ViewArguments& arguments) {
  add_text(app,
           {"--screenshot", "PNG",
            "Draw into this file, - for standard output, without a window or a display"},
           [&](const std::string& text) { arguments.screenshot = text; });
  add_text(app,
           {"--turntable", "DIR", "Draw a full turn into DIR/0000.png and so on, without a window"},
           [&](const std::string& text) { arguments.turntable = text; });
  add_parsed(app, arguments.frames,
             [](const std::string& text) { return parse_int(text, 1, 100'000); },
             {"--frames", "N", "Pictures of the turn", "120"});
  add_repeated(app, {"--slice", "AXIS:PART", "Show the samples across an axis, such as z:0.5"},
               [&](const std::string& text) { parse_slice(text, arguments.settings); });
  add_flag(app, "--plain", arguments.plain, "No box, axes or scale bar");
}

}  // namespace

void add_view(Program& program) {
  auto arguments = std::make_shared<ViewArguments>();
  CLI::App* app = add_subcommand(
      program, "view", "Look at a volume: move the isovalue, fly through it, take pictures.",
      "isobrick view head.zarr --isovalue 500");
  add_input(app, arguments->input, false);
  add_isovalues(app, arguments->isovalues, "Surface to begin with",
                "the one that 'isobrick extract' suggests, mostly Otsu's threshold");
  add_parsed(
      app, arguments->level, [](const std::string& text) { return parse_int(text, 0, 64); },
      {"--level", "L", "Show no finer level of the pyramid than this one, 0 the finest", "0"});
  add_region(app, arguments->region);
  add_picture_options(app, arguments->picture, "surface");
  add_inside(app, arguments->budgets.inside);
  add_what_to_draw(app, *arguments);
  add_parsed(app, arguments->settings.pixel_error, parse_pixel_error,
             {"--pixel-error", "PIXELS", "How long a cell may be on the picture", "1.5"});
  add_search(app, arguments->search);
  add_parsed(app, arguments->budgets.backend, parse_backend,
             {"--backend", "auto|cpu|cuda",
              "What makes the meshes, the same on either; auto: a GPU where there is one", "auto"});
  add_memory(app, arguments->budgets.memory);
  add_parsed(app, arguments->budgets.device_memory, parse_bytes,
             {"--gpu-memory", "BYTES", "For meshes on the graphics device", "1G"});
  add_threads(app, arguments->budgets.threads);
  add_force(app, arguments->force);
  add_run(program, app, arguments, run_view);
}

}  // namespace isobrick::tools

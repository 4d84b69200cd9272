// What somebody at the viewer waits for, off-screen, through the code of its window: the
// first surface after opening and after each jump of the isovalue, how long pictures take while
// meshes come in, while the isovalue slides and while the camera turns, and the full
// refinement of a region beside the batch extraction of the same region.
//
//   isobrick synth gyroid g.zarr --dims 512,512,512
//   bench_viewer_stream g.zarr --isovalue 127.5 --to 160.5 --json
//
// A picture's time ends with glFinish. Pictures are started at most 60 times a second, as a
// display would have them; the one that shows everything when all is there, since a display has
// room for one more that waits for its turn. A frame is what input waits for: a whole picture while
// something moves, otherwise a piece of one or what is done between two; those of less than a
// millisecond do not count.

#include <epoxy/gl.h>
#include <fmt/format.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "bench/guarded_main.h"
#include "bench/picture_times.h"
#include "isobrick/core/error.h"
#include "isobrick/pipeline/extract.h"
#include "isobrick/pipeline/gpu_backend.h"
#include "isobrick/render/gl_context.h"
#include "isobrick/window/frame_pacer.h"
#include "isobrick/window/store_picture.h"

namespace isobrick::bench {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

struct Arguments {
  std::string store;
  double isovalue = 127.5, to = 160.5;
  int width = 1280, height = 800, jumps = 4, region = 256;
  double seconds = 4;  ///< of sliding, of turning
  double memory_gib = 2, gpu_memory_gib = 2;
  int threads = 0;
  std::string backend = "auto";
  bool json = false;
};

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::uint64_t bytes_of(double gib) { return static_cast<std::uint64_t>(gib * (1 << 30)); }

/// A store on a screen of no window.
class Session {
 public:
  Session(const Arguments& arguments, const PictureBudgets& budgets,
          const std::shared_ptr<PictureSetup>& setup)
      : arguments_(arguments),
        opened_(Clock::now()),
        store_(std::make_shared<const StoreReader>(arguments.store)) {
    read_seconds = seconds_since(opened_);
    picture_ = std::make_unique<StorePicture>(
        store_, budgets, [this] { changed_ = Clock::now(); }, setup);
    set_up_seconds = seconds_since(opened_);
    settings.surfaces = {{arguments.isovalue, surface_colour(0), 1, true}};
    settings.multisample = !software_;
    choose_values(settings, picture_->scene().tree());
    const WorldBox box = picture_->bounds();
    camera.fit(box.lo, box.hi, static_cast<double>(arguments.width) / arguments.height);
  }

  StorePicture& picture() { return *picture_; }
  double since_opened() const { return seconds_since(opened_); }
  /// Seconds from `start` until the last mesh came.
  double changed_after(Clock::time_point start) const {
    return std::chrono::duration<double>(changed_.load() - start).count();
  }

  /// One frame as the window makes it. `moving`: its picture may be a simpler one.
  void draw(bool moving) { make_frame(moving); }
  /// At most 60 times a second until `done`, and when all is there without waiting for the
  /// next turn of a display, unless the picture before the last is waiting for it. Throws Error
  /// when that takes longer than two minutes.
  template <class F>
  void draw_until(bool moving, F&& done) {
    const auto start = Clock::now();
    while (seconds_since(start) < 120) {
      const auto next = Clock::now() + kPeriod;
      draw(moving);
      if (done()) return;
      if (picture_->state().drawing) continue;
      const std::chrono::duration<double> left = next - Clock::now();
      const bool all_there = !moving && picture_->scene().stream().wait_idle(left.count());
      std::this_thread::sleep_until(all_there ? std::min(next, began_before_ + kPeriod) : next);
    }
    throw Error("what is waited for is not there after 120 s");
  }

  ViewSettings settings;
  Camera camera{{0.5, -1, 0.35}, {0, 0, 0}, {0, 0, 1}};
  double read_seconds = 0, set_up_seconds = 0;
  std::uint64_t device_peak = 0;
  Times at_rest;  ///< pictures in full when nothing moves and nothing is missing

  /// Since it was last asked: frames, and whole pictures but for those at rest.
  Json take_times() {
    Json json = std::exchange(frames_, {}).summary(pace_);
    json["whole_pictures"] = std::exchange(pictures_, {}).summary();
    return json;
  }

 private:
  static constexpr auto kPeriod = std::chrono::microseconds(16'667);
  static constexpr double kLeast = 1e-3;  ///< seconds of a frame that counts

  void make_frame(bool moving) {
    const auto start = Clock::now();
    PictureWay way{.coarser = moving ? pacer_.coarser() : 1,
                   .piece_seconds = PictureWay::usual_piece(software_, moving),
                   .patience_seconds = kPatienceSeconds,
                   .moving = moving};
    if (pacer_.plain())
      way.plain = moving ? PictureWay::Plain::yes : PictureWay::Plain::until_complete;
    const int smaller = moving ? pacer_.smaller() : 1;
    picture_->draw(camera, arguments_.width / smaller, arguments_.height / smaller, settings, way);
    const double submitted = seconds_since(start);
    glFinish();
    const double seconds = seconds_since(start);
    const PictureState& state = picture_->state();
    if (seconds >= kLeast) frames_.add(seconds, picture_->times(), seconds - submitted);
    device_peak = std::max(device_peak, state.device_bytes);
    if (picture_->drew() || state.more) began_before_ = std::exchange(began_, start);
    if (!picture_->drew()) return;  // nothing is drawn that would look the same
    const double whole = std::max(seconds, picture_->picture_seconds());
    (!moving && state.complete && !state.plain ? at_rest : pictures_).add(whole);
    if (moving)
      pacer_.drawn(whole);
    else if (!state.plain)
      pacer_.drawn_still(whole);
  }

  const Arguments& arguments_;
  Clock::time_point opened_;
  Clock::time_point began_, began_before_;  ///< the last frames that may have been shown
  std::atomic<Clock::time_point> changed_{Clock::time_point()};
  std::shared_ptr<const StoreReader> store_;
  std::unique_ptr<StorePicture> picture_;
  PicturesTimes frames_;
  Times pictures_;
  const bool software_ = current_gl_device().software;
  FramePacer pacer_ = FramePacer::for_device(software_);
  MachinePace pace_;
};

/// Takes a mesh and keeps nothing.
class NoSink final : public MeshSink {
 public:
  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk& chunk) override {
    bytes_ +=
        chunk.positions.size_bytes() + chunk.normals.size_bytes() + chunk.triangles.size_bytes();
  }
  void finish() override {}
  std::uint64_t bytes() const override { return bytes_; }

 private:
  std::uint64_t bytes_ = 0;
};

Json stream_json(const StreamCounters& c) {
  return {{"meshes_made", c.meshes_made},        {"meshes_made_by_device", c.device_meshes_made},
          {"device_mesh_bytes", c.device_bytes}, {"bricks_read", c.bricks_read},
          {"decode_seconds", c.decode_seconds},  {"mesh_seconds", c.mesh_seconds},
          {"mesh_bytes", c.mesh_bytes},          {"brick_bytes_peak", c.brick_bytes_peak}};
}

/// The isovalue goes to and fro, another one with every picture.
Json slide(Session& session, const Arguments& arguments) {
  Times behind;
  std::map<double, Clock::time_point> asked;
  const auto start = Clock::now();
  session.draw_until(true, [&] {
    const std::vector<double>& shown = session.picture().state().isovalues;
    const auto found = shown.empty() ? asked.end() : asked.find(shown[0]);
    if (found != asked.end()) behind.add(seconds_since(found->second));
    const double turn = seconds_since(start) / arguments.seconds;
    const double part = 0.5 + 0.5 * std::cos(turn * 2 * 3.14159265358979);
    const double isovalue = arguments.isovalue + part * (arguments.to - arguments.isovalue);
    session.settings.surfaces[0].isovalue = isovalue;
    asked.emplace(isovalue, Clock::now());
    return turn >= 1;
  });
  Json result = session.take_times();
  // From asking for an isovalue to the end of a picture of its surface.
  result["surface_behind_slider"] = behind.summary();
  return result;
}

Json device_json(const DeviceMesher::Times& t) {
  return {{"launches", t.launches},     {"meshes", t.grids},
          {"turn_seconds", t.turn},     {"memory_seconds", t.memory},
          {"device_seconds", t.device}, {"hand_out_seconds", t.hand_out}};
}

/// Whether the picture shows all that there is, as well as it can.
bool complete_in_full(Session& session) {
  const PictureState& state = session.picture().state();
  return state.complete && !state.plain;
}

/// The first store of a process, beside the opening of the device.
Json first_opening(const Arguments& arguments, const PictureBudgets& budgets,
                   const std::shared_ptr<PictureSetup>& setup) {
  Session session(arguments, budgets, setup);
  session.draw_until(true, [&] { return session.picture().state().covers; });
  Json result{{"first_surface_ms", session.since_opened() * 1e3}};
  session.draw_until(false, [&] { return complete_in_full(session); });
  result["complete_ms"] = session.since_opened() * 1e3;
  // The device may be there only now.
  session.draw_until(false, [&] {
    const auto& device = setup->device();
    return !device->begun() || device->over();
  });
  result["frames"] = session.take_times();
  return result;
}

/// Opening until the whole volume is refined as far as picture and budget go; jumps;
/// sliding; turning.
Json interactive(const Arguments& arguments, const PictureBudgets& budgets,
                 const std::shared_ptr<PictureSetup>& setup) {
  Session session(arguments, budgets, setup);
  Json result;
  const auto covers = [&] { return session.picture().state().covers; };
  const auto complete = [&] { return complete_in_full(session); };
  session.draw_until(true, covers);
  result["open"] = {{"store_ms", session.read_seconds * 1e3},
                    {"set_up_ms", session.set_up_seconds * 1e3},
                    {"first_surface_ms", session.since_opened() * 1e3}};
  session.draw_until(false, complete);
  result["open"]["complete_ms"] = session.since_opened() * 1e3;
  result["open"]["triangles"] = session.picture().state().triangles;
  result["open"]["nodes"] = session.picture().state().nodes;
  result["open"]["limited_by_budget"] = session.picture().state().limited_by_budget;
  Json jumps = Json::array();
  for (int i = 1; i <= arguments.jumps; ++i) {
    const double part = static_cast<double>(i) / arguments.jumps;
    session.settings.surfaces[0].isovalue =
        arguments.isovalue + part * (arguments.to - arguments.isovalue);
    const auto start = Clock::now();
    Json jump{{"isovalue", session.settings.surfaces[0].isovalue}};
    // As the window does: simpler pictures until there is one of the new surface.
    session.draw(true);
    session.draw_until(true, covers);
    jump["first_surface_ms"] = seconds_since(start) * 1e3;
    session.draw_until(false, complete);
    jump["complete_ms"] = seconds_since(start) * 1e3;
    jumps.push_back(jump);
  }
  result["jumps"] = jumps;
  result["while_streaming"] = session.take_times();
  result["at_rest"] = session.at_rest.summary();

  result["while_sliding"] = slide(session, arguments);

  const auto orbit = Clock::now();
  const Camera from = session.camera;
  session.draw_until(true, [&] {
    const double turn = seconds_since(orbit) / arguments.seconds;
    session.camera = from;
    session.camera.orbit(turn * 2 * 3.14159265358979, 0, {0, 0, 1});
    return turn >= 1;
  });
  result["while_turning"] = session.take_times();
  const CutTimes cut = session.picture().scene().times();
  result["last_cut"] = {
      {"search_ms", cut.search * 1e3}, {"cut_ms", cut.cut * 1e3}, {"plan_ms", cut.plan * 1e3}};
  result["meshes_by"] = session.picture().device().describe();
  result["stream"] = stream_json(session.picture().scene().stream().counters());
  result["device"] = device_json(session.picture().device().times());
  result["device_bytes_peak"] = session.device_peak;
  return result;
}

/// A region in the middle, all of level 0, from nothing to complete, beside the extraction of
/// the same samples.
Json refinement(const Arguments& arguments, const PictureBudgets& budgets,
                const std::shared_ptr<PictureSetup>& setup) {
  Json result;
  const StoreReader store(arguments.store);
  const Int3 extent = store.info().levels.front().lattice.extent;
  Box3 roi;
  for (int axis = 0; axis < 3; ++axis) {
    const Index edge = std::min<Index>(arguments.region, extent[axis] - 1);
    roi.lo[axis] = (extent[axis] - 1 - edge) / 2 / 64 * 64;
    roi.hi[axis] = roi.lo[axis] + edge + 1;
  }
  const auto extract_with = [&](Backend backend, const char* name) {
    ExtractOptions options;
    options.isovalue = arguments.isovalue;
    options.roi = roi;
    options.normals = true;
    options.memory = budgets.memory;
    options.threads = budgets.threads;
    options.backend = backend;
    NoSink sink;
    NoProgress progress;
    const auto start = Clock::now();
    const ExtractReport report = extract(store, options, sink, progress);
    result[name] = {{"seconds", seconds_since(start)}, {"triangles", report.triangles}};
  };
  extract_with(Backend::cpu, "first_extract_cpu");  // reads the store into the page cache
  extract_with(Backend::cpu, "extract_cpu");
  if (budgets.backend != Backend::cpu && cuda_device_count() > 0) {
    extract_with(Backend::cuda, "first_extract_cuda");  // sets the device up
    extract_with(Backend::cuda, "extract_cuda");
  }

  glFinish();  // the session before may still be giving memory back
  Session session(arguments, budgets, setup);
  session.settings.region_on = true;
  for (int axis = 0; axis < 3; ++axis) {
    const auto last = static_cast<double>(extent[axis] - 1);
    // Neighbours that only touch it stay out.
    session.settings.region_lo[axis] =
        static_cast<float>((static_cast<double>(roi.lo[axis]) + 0.5) / last);
    session.settings.region_hi[axis] =
        static_cast<float>((static_cast<double>(roi.hi[axis]) - 1.5) / last);
  }
  session.settings.pixel_error = 0.02f;
  const auto start = Clock::now();
  Json ends = Json::array();  // of pictures, and how much each showed
  session.draw_until(false, [&] {
    const PictureState& state = session.picture().state();
    ends.push_back({seconds_since(start) * 1e3, state.nodes, state.triangles});
    return complete_in_full(session);
  });
  result["refine"] = {{"seconds", seconds_since(start)},
                      {"triangles", session.picture().state().triangles},
                      {"nodes", session.picture().state().nodes},
                      {"limited_by_budget", session.picture().state().limited_by_budget},
                      {"picture_ends_ms_nodes_triangles", ends},
                      {"last_mesh_seconds", session.changed_after(start)},
                      {"frames", session.take_times()},
                      {"at_rest", session.at_rest.summary()},
                      {"device", device_json(session.picture().device().times())},
                      {"stream", stream_json(session.picture().scene().stream().counters())}};
  return result;
}

int run(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"What somebody at the viewer waits for"};
  app.add_option("store", arguments.store)->required();
  app.add_option("--isovalue", arguments.isovalue);
  app.add_option("--to", arguments.to, "Where jumps and sliding end");
  app.add_option("--jumps", arguments.jumps);
  app.add_option("--seconds", arguments.seconds, "Of sliding, of turning");
  app.add_option("--region", arguments.region, "Edge, in cells, of what is refined fully");
  app.add_option("--width", arguments.width);
  app.add_option("--height", arguments.height);
  app.add_option("--memory", arguments.memory_gib, "GiB of host memory");
  app.add_option("--gpu-memory", arguments.gpu_memory_gib, "GiB for meshes on the device");
  app.add_option("--threads", arguments.threads);
  app.add_option("--backend", arguments.backend)->check(CLI::IsMember({"auto", "cpu", "cuda"}));
  app.add_flag("--json", arguments.json, "On one line");
  CLI11_PARSE(app, argc, argv);

  const GlContext context;
  PictureBudgets budgets;
  budgets.memory = bytes_of(arguments.memory_gib);
  budgets.device_memory = bytes_of(arguments.gpu_memory_gib);
  budgets.threads = arguments.threads;
  budgets.backend = arguments.backend == "cpu"    ? Backend::cpu
                    : arguments.backend == "cuda" ? Backend::cuda
                                                  : Backend::automatic;
  Json result{{"store", arguments.store},
              {"renderer", current_gl_device().renderer},
              {"cores", std::thread::hardware_concurrency()},
              {"size", fmt::format("{}x{}", arguments.width, arguments.height)}};
  // As a window does when it is made, before any store is opened.
  const auto start = Clock::now();
  const auto setup = std::make_shared<PictureSetup>(
      budgets, [] {}, PictureSize{arguments.width, arguments.height});
  result["set_up_ms"] = seconds_since(start) * 1e3;
  // First what is best measured in a process that has drawn nothing yet.
  result["first_opening"] = first_opening(arguments, budgets, setup);
  glFinish();  // the session before may still be giving memory back
  result["interactive"] = interactive(arguments, budgets, setup);
  result["refinement"] = refinement(arguments, budgets, setup);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  result["peak_resident_bytes"] = static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
  std::cout << result.dump(arguments.json ? -1 : 2) << '\n';
  return 0;
}

}  // namespace
}  // namespace isobrick::bench

int main(int argc, char** argv) {
  return isobrick::bench::guarded_main("bench_viewer_stream", isobrick::bench::run, argc, argv);
}

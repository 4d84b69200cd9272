// Measures what a user of the viewer waits for, off-screen, through the code of its window. These
// are the first surface after opening and after each jump of the isovalue, and frame times during
// streaming, sliding and orbiting. The full refinement of a region is compared with its batch
// extraction.
//
//   isobrick synth gyroid g.zarr --dims 512,512,512
//   bench_viewer_stream g.zarr --isovalue 127.5 --to 160.5 --json
//
// A frame's time ends with glFinish. Frames start at most 60 times a second, as on a display; the
// final one starts as soon as all meshes are resident. A frame is what delays input: a whole
// picture, in software a draw batch, or the work between two; frames below a millisecond do not
// count. Built as in bench/README.md.

#include <epoxy/gl.h>
#include <fmt/format.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include <isobrick/extract.h>
#include "bench/guarded_main.h"
#include "bench/median.h"
#include "bench/viewer_session.h"
#include "pipeline/extract/gpu_backend.h"
#include "viewer/render/gl_context.h"

namespace isobrick::bench {
namespace {

using Json = nlohmann::ordered_json;

std::uint64_t bytes_of(double gib) { return static_cast<std::uint64_t>(gib * (1 << 30)); }

/// A sink that discards the mesh.
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

/// Slides the isovalue to and fro, another one for each frame.
Json slide(Session& session, const Arguments& arguments) {
  Times behind;
  std::map<double, Clock::time_point> requested;
  const auto start = Clock::now();
  session.draw_until(true, [&] {
    const std::vector<double>& shown = session.renderer().state().isovalues;
    const auto found = shown.empty() ? requested.end() : requested.find(shown[0]);
    if (found != requested.end()) behind.add(seconds_since(found->second));
    const double turn = seconds_since(start) / arguments.seconds;
    const double part = 0.5 + 0.5 * std::cos(turn * 2 * 3.14159265358979);
    const double isovalue = arguments.isovalue + part * (arguments.to - arguments.isovalue);
    session.settings.surfaces[0].isovalue = isovalue;
    requested.emplace(isovalue, Clock::now());
    return turn >= 1;
  });
  Json result = session.take_times();
  // From the request of an isovalue to the end of a frame that shows it.
  result["surface_behind_slider"] = behind.summary();
  return result;
}

Json device_json(const DeviceMesher::Times& t) {
  return {{"launches", t.launches},     {"meshes", t.grids},
          {"lock_seconds", t.lock},     {"memory_seconds", t.memory},
          {"device_seconds", t.device}, {"deliver_seconds", t.deliver}};
}

/// Whether the frame is complete and in full quality.
bool complete_in_full(Session& session) {
  const FrameState& state = session.renderer().state();
  return state.complete && !state.reduced_quality;
}

/// Opens the first store of a process, while the device is opened.
Json first_opening(const Arguments& arguments, const PictureBudgets& budgets,
                   const std::shared_ptr<PictureSetup>& setup) {
  Session session(arguments, budgets, setup);
  session.draw_until(true, [&] { return session.renderer().state().covers; });
  Json result{{"first_surface_ms", session.since_opened() * 1e3}};
  session.draw_until(false, [&] { return complete_in_full(session); });
  result["complete_ms"] = session.since_opened() * 1e3;
  // The device may open only now.
  session.draw_until(false, [&] {
    const auto& device = setup->device();
    return !device->has_begun() || device->is_done();
  });
  result["frames"] = session.take_times();
  return result;
}

/// Opening, until the volume is refined within the budget; jumps; sliding; orbiting.
Json interactive(const Arguments& arguments, const PictureBudgets& budgets,
                 const std::shared_ptr<PictureSetup>& setup) {
  Session session(arguments, budgets, setup);
  Json result;
  const auto covers = [&] { return session.renderer().state().covers; };
  const auto complete = [&] { return complete_in_full(session); };
  session.draw_until(true, covers);
  result["open"] = {{"store_ms", session.read_seconds * 1e3},
                    {"set_up_ms", session.set_up_seconds * 1e3},
                    {"first_surface_ms", session.since_opened() * 1e3}};
  session.draw_until(false, complete);
  result["open"]["complete_ms"] = session.since_opened() * 1e3;
  result["open"]["triangles"] = session.renderer().state().triangles;
  result["open"]["nodes"] = session.renderer().state().nodes;
  result["open"]["limited_by_budget"] = session.renderer().state().limited_by_budget;
  Json jumps = Json::array();
  for (int i = 1; i <= arguments.jumps; ++i) {
    const double part = static_cast<double>(i) / arguments.jumps;
    session.settings.surfaces[0].isovalue =
        arguments.isovalue + part * (arguments.to - arguments.isovalue);
    const auto start = Clock::now();
    Json jump{{"isovalue", session.settings.surfaces[0].isovalue}};
    // As in the window: previews until the new surface is shown.
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
  const CutTimes cut = session.renderer().scene().times();
  result["last_cut"] = {
      {"search_ms", cut.search * 1e3}, {"cut_ms", cut.cut * 1e3}, {"plan_ms", cut.plan * 1e3}};
  result["meshes_by"] = session.renderer().device().describe();
  result["stream"] = stream_json(session.renderer().scene().stream().counters());
  result["device"] = device_json(session.renderer().device().times());
  result["device_bytes_peak"] = session.device_peak;
  return result;
}

/// A region in the middle, all of level 0.
Box3 region_of(const StoreReader& store, int edge_cells) {
  const Int3 extent = store.info().levels.front().lattice.extent;
  Box3 roi;
  for (int axis = 0; axis < 3; ++axis) {
    const Index edge = std::min<Index>(edge_cells, extent[axis] - 1);
    roi.lo[axis] = (extent[axis] - 1 - edge) / 2 / 64 * 64;
    roi.hi[axis] = roi.lo[axis] + edge + 1;
  }
  return roi;
}

/// Batch extraction of the region's samples; returns seconds and triangles.
std::pair<double, std::uint64_t> extract_region(const StoreReader& store, Box3 roi,
                                                const Arguments& arguments,
                                                const PictureBudgets& budgets, Backend backend) {
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
  return {seconds_since(start), report.triangles};
}

/// Refines the region from the start until it is complete.
Json refine_region(const StoreReader& store, Box3 roi, const Arguments& arguments,
                   const PictureBudgets& budgets, const std::shared_ptr<PictureSetup>& setup) {
  glFinish();  // the session before may still be giving memory back
  Session session(arguments, budgets, setup);
  session.settings.region_on = true;
  const Int3 extent = store.info().levels.front().lattice.extent;
  for (int axis = 0; axis < 3; ++axis) {
    const auto last = static_cast<double>(extent[axis] - 1);
    // Neighbours that only touch the region are left out.
    session.settings.region_lo[axis] =
        static_cast<float>((static_cast<double>(roi.lo[axis]) + 0.5) / last);
    session.settings.region_hi[axis] =
        static_cast<float>((static_cast<double>(roi.hi[axis]) - 1.5) / last);
  }
  session.settings.pixel_error = 0.02f;
  const auto start = Clock::now();
  Json ends = Json::array();  // end of each frame, and its triangles
  session.draw_until(false, [&] {
    const FrameState& state = session.renderer().state();
    ends.push_back({seconds_since(start) * 1e3, state.nodes, state.triangles});
    return complete_in_full(session);
  });
  return {{"seconds", seconds_since(start)},
          {"triangles", session.renderer().state().triangles},
          {"nodes", session.renderer().state().nodes},
          {"limited_by_budget", session.renderer().state().limited_by_budget},
          {"picture_ends_ms_nodes_triangles", ends},
          {"last_mesh_seconds", session.changed_after(start)},
          {"frames", session.take_times()},
          {"at_rest", session.at_rest.summary()},
          {"device", device_json(session.renderer().device().times())},
          {"stream", stream_json(session.renderer().scene().stream().counters())}};
}

/// Alternates a region's refinement and its extraction. Reports medians, and all times.
Json refinement(const Arguments& arguments, const PictureBudgets& budgets,
                const std::shared_ptr<PictureSetup>& setup) {
  const StoreReader store(arguments.store);
  const Box3 roi = region_of(store, arguments.region);
  const bool cuda = budgets.backend != Backend::cpu && cuda_device_count() > 0;
  std::map<std::string, std::vector<double>> seconds;
  std::uint64_t triangles = 0;
  const auto extract_with = [&](Backend backend, const char* name) {
    const auto [took, made] = extract_region(store, roi, arguments, budgets, backend);
    seconds[name].push_back(took);
    triangles = made;
  };
  extract_with(Backend::cpu, "first_extract_cpu");  // reads the store into the page cache
  if (cuda) extract_with(Backend::cuda, "first_extract_cuda");  // sets the device up
  Json result;
  for (int turn = 0; turn < arguments.turns; ++turn) {
    extract_with(Backend::cpu, "extract_cpu");
    if (cuda) extract_with(Backend::cuda, "extract_cuda");
    Json refined = refine_region(store, roi, arguments, budgets, setup);
    seconds["refine"].push_back(refined["seconds"].get<double>());
    if (turn == 0) result["first_refine"] = std::move(refined);
  }
  for (const auto& [name, all] : seconds)
    result[name] = {{"seconds", median(all)}, {"all_seconds", all}};
  result["extracted_triangles"] = triangles;
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
  app.add_option("--turns", arguments.turns, "Refinements and extractions of that")
      ->check(CLI::PositiveNumber);
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
  // As a window does before it opens a store.
  const auto start = Clock::now();
  const auto setup = std::make_shared<PictureSetup>(
      budgets, [] {}, PictureSize{arguments.width, arguments.height});
  result["set_up_ms"] = seconds_since(start) * 1e3;
  // First the measurement that needs a process which has drawn nothing.
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

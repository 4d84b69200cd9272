// The experiment of Cirne and Pedrini, "Marching cubes technique for volumetric
// visualization accelerated with graphics processing units" (J. Brazilian
// Computer Society 19, 2013): brute force and span-space structures
// over ten volumes, beside VTK's own span-space searches, and on the GPU where
// there is one. Writes one JSON object for each volume; bench/paper/report makes
// tables and plots of them.
//
//   bench_paper --data FOLDER > paper.jsonl
//   bench_paper --gyroid 512 --frequency 1        # one volume, 1 % of its cells active
// Built as in bench/README.md.

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "bench/paper/measure.h"
#ifdef ISOBRICK_WITH_CUDA
#include "bench/paper/measure_gpu.h"
#endif

int main(int argc, char** argv) {
  using namespace isobrick;
  CLI::App app{"Span-space structures over the paper's ten volumes"};
  std::string data, raw, machine;
  Index edge = 0;
  double frequency = 1, isovalue = 127.5;
  bench::MeasureOptions options;
  bool no_cells = false, no_peers = false, no_gpu = false;
  app.add_option("--data", data, "folder with real volumes; what is not there is made up");
  app.add_option("--gyroid", edge, "a gyroid of so many samples along each edge instead");
  app.add_option("--frequency", frequency, "of the gyroid");
  app.add_option("--raw", raw, "one raw volume instead");
  app.add_option("--isovalue", isovalue, "of the raw volume");
  app.add_option("--runs", options.runs);
  app.add_option("--threads", options.threads);
  app.add_option("--machine", machine, "what to call the machine in the tables");
  app.add_flag("--no-cells", no_cells, "leave the structures over single cells out");
  app.add_flag("--no-peers", no_peers, "leave VTK out");
  app.add_flag("--no-gpu", no_gpu, "leave the GPU out");
  CLI11_PARSE(app, argc, argv);
  options.cells = !no_cells;
  options.peers = !no_peers;
  const auto report = [&](const bench::LoadedVolume& v) {
    nlohmann::json out = measure(v, options);
    out["machine"] = machine;
#ifdef ISOBRICK_WITH_CUDA
    if (!no_gpu && gpu::device_available()) out["gpu"] = measure_gpu(v, options);
#endif
    fmt::print("{}\n", out.dump());
    std::fflush(stdout);
  };
  if (edge > 0) {
    report(bench::gyroid({edge, edge, edge}, frequency));
  } else if (!raw.empty()) {
    report(bench::load_raw(raw, isovalue));
  } else {
    for (const bench::PaperVolume& paper : bench::kPaperVolumes) report(bench::load(paper, data));
  }
}

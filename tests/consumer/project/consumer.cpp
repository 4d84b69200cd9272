// consumer FOLDER [MODULE...]: makes a volume, converts it, extracts its surface: everything
// through the installed headers and libraries. Then loads the modules of formats that are named.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string_view>

#include <isobrick/bricks/store_reader.h>
#include <isobrick/core/progress.h>
#include <isobrick/meshes/ply_sink.h>
#include <isobrick/pipeline/convert.h>
#include <isobrick/pipeline/extract.h>
#include <isobrick/volumes/module_loader.h>
#include <isobrick/volumes/synth_source.h>

namespace {

int run(const std::filesystem::path& folder) {
  isobrick::NoProgress progress;
  const auto source =
      isobrick::make_synth({.kind = isobrick::SynthKind::sphere, .extent = {48, 40, 33}});
  isobrick::ConvertOptions convert_options;
  convert_options.force = true;
  isobrick::convert(*source, folder / "sphere.zarr", convert_options, progress);

  const isobrick::StoreReader store(folder / "sphere.zarr");
  isobrick::ExtractOptions options;
  options.isovalue = isobrick::default_isovalue(store.info().type);
  isobrick::PlySink sink((folder / "sphere.ply").string(), true);
  const isobrick::ExtractReport report = isobrick::extract(store, options, sink, progress);
  std::printf("%llu triangles\n", static_cast<unsigned long long>(report.triangles));
  return report.triangles > 0 ? 0 : 1;
}

const char* version_of(std::string_view module) {
  if (module == "hdf5") return isobrick::hdf5_module().version;
  if (module == "dicom") return isobrick::dicom_module().version;
  if (module == "openvdb") return isobrick::vdb_module().version;
  throw std::runtime_error("no such module");
}

}  // namespace

int main(int argc, char** argv) {
  try {
    for (int i = 2; i < argc; ++i) std::printf("%s %s\n", argv[i], version_of(argv[i]));
    return run(argc > 1 ? argv[1] : ".");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}

// consumer FOLDER [FORMAT...]: makes a volume, converts it, extracts its surface: everything
// through the installed headers and libraries. Then makes the library load the modules of the
// formats that are named.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>

#include <isobrick/convert.h>
#include <isobrick/error.h>
#include <isobrick/export.h>
#include <isobrick/extract.h>
#include <isobrick/histogram.h>
#include <isobrick/isovalue.h>
#include <isobrick/mesh_file_sink.h>
#include <isobrick/open_source.h>
#include <isobrick/open_volume.h>
#include <isobrick/progress.h>
#include <isobrick/store_reader.h>
#include <isobrick/synth_source.h>

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
  const auto mesh = isobrick::create_mesh_file(folder / "sphere.ply", {.force = true});
  const isobrick::ExtractReport report = isobrick::extract(store, options, *mesh, progress);
  std::printf("%llu triangles\n", static_cast<unsigned long long>(report.triangles));
  return report.triangles > 0 ? 0 : 1;
}

/// The same surface from a file that is no store, at an isovalue that its samples give.
int run_on_file(const std::filesystem::path& folder) {
  isobrick::NoProgress progress;
  const std::filesystem::path file = folder / "sphere.nrrd";
  isobrick::export_volume(isobrick::StoreReader(folder / "sphere.zarr"), file,
                          {.format = isobrick::ExportFormat::nrrd, .force = true}, progress);
  const isobrick::OpenedVolume volume(file.string(), {.cache = {folder / "cache"}}, progress);
  const auto samples = isobrick::histogram(volume.store(), progress, 1 << 16);
  isobrick::ExtractOptions options;
  options.isovalue = isobrick::resolve_isovalue(isobrick::parse_isovalues("otsu").front(), samples,
                                                volume.store().info().type);
  const auto mesh = isobrick::create_mesh_file(folder / "otsu.ply", {.force = true});
  return isobrick::extract(volume.store(), options, *mesh, progress).triangles > 0 ? 0 : 1;
}

/// Opens a file that begins as those of a format do, and is none: the format's module refuses it.
void load_reader(const std::filesystem::path& file, std::string_view begin) {
  std::ofstream(file, std::ios::binary) << begin << std::string(4096, '\0');
  try {
    (void)isobrick::open_source(file.string(), {});
  } catch (const isobrick::Error& error) {
    if (std::string_view(error.what()).find("install isobrick") != std::string_view::npos) throw;
    return;
  }
  throw std::runtime_error("a file of zeros was read as a volume");
}

void load_module(std::string_view format, const std::filesystem::path& folder) {
  using namespace std::string_view_literals;
  if (format == "hdf5") return load_reader(folder / "a.h5", "\x89HDF\r\n\x1a\n"sv);
  if (format == "dicom") return load_reader(folder / "a.dcm", std::string(128, '\0') + "DICM");
  if (format != "openvdb") throw std::runtime_error("no such module");
  isobrick::NoProgress progress;
  isobrick::export_volume(isobrick::StoreReader(folder / "sphere.zarr"), folder / "sphere.vdb",
                          {.format = isobrick::ExportFormat::vdb, .force = true}, progress);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const std::filesystem::path folder = argc > 1 ? argv[1] : ".";
    const int result = run(folder) + run_on_file(folder);
    for (int i = 2; i < argc; ++i) load_module(argv[i], folder);
    return result;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}

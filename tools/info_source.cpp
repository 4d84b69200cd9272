#include "tools/info_source.h"

#include <filesystem>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/open_source.h>
#include "io/volumes/open/volume_format.h"
#include "tools/format.h"
#include "tools/label_report.h"

namespace isobrick::tools {
namespace {

std::string format_of(const std::string& path) {
  std::error_code none;
  if (path == "-") return "raw";
  if (std::filesystem::is_directory(path, none)) return "folder of slices";
  return std::string(name_of(recognise_format(split_volume_path(path).file)));
}

/// A header and its samples may be one file.
std::size_t file_count(const VolumeInfo& info) {
  return std::set<std::filesystem::path>(info.files.begin(), info.files.end()).size();
}

nlohmann::ordered_json json_of(const InputArguments& input, const VolumeInfo& info,
                               const std::vector<std::string>& notes, std::uint64_t raw_bytes) {
  return {{"command", "info"},
          {"input", input.path},
          {"format", format_of(input.path)},
          {"extent", to_json(info.extent)},
          {"type", zarr_name(info.type)},
          {"spacing", to_json(info.transform.spacing)},
          {"origin", to_json(info.transform.origin)},
          {"direction", info.transform.direction},
          {"unit", info.transform.unit},
          {"codec", nullptr},
          {"codec_sample", nullptr},
          {"codec_advice", nullptr},
          {"fill_value", to_json(info.fill_value)},
          {"grid_class", info.grid_class},
          {"grid_name", info.grid_name},
          {"labels", labels_json(info.labels)},
          {"label_images", nlohmann::ordered_json::array()},
          {"levels", nlohmann::ordered_json::array()},
          {"files", file_count(info)},
          {"bytes", nullptr},
          {"raw_bytes", raw_bytes},
          {"ratio", nullptr},
          {"value_range", nullptr},
          {"histogram", nullptr},
          {"index_kinds", nlohmann::ordered_json::array()},
          {"indexes", nlohmann::ordered_json::array()},
          {"notes", notes},
          {"peak_resident_bytes", peak_resident_bytes()}};
}

}  // namespace

void report_source(const InputArguments& input, Console& console) {
  const auto source = open_source(input.path, input.volume);
  const VolumeInfo& info = source->info();
  const std::uint64_t raw_bytes =
      static_cast<std::uint64_t>(volume(info.extent)) * size_of(info.type);
  const std::vector<std::string> notes =
      source->random_access() ? source->notes() : std::vector<std::string>{};
  const std::size_t files = file_count(info);
  std::string text = fmt::format("volume       {}\n", input.path);
  text += fmt::format("format       {}, {} file{}\n", format_of(input.path), files,
                      files == 1 ? "" : "s");
  text += fmt::format("extent       {} samples of {}, {}\n", human_extent(info.extent),
                      zarr_name(info.type), human_bytes(raw_bytes));
  text += place_text(info.transform);
  if (!info.grid_name.empty()) text += fmt::format("grid         {}\n", info.grid_name);
  if (!info.grid_class.empty()) text += fmt::format("grid class   {}\n", info.grid_class);
  text += labels_text(info.labels);
  text += "histogram    with --stats, which reads all samples\n";
  console.result(json_of(input, info, notes, raw_bytes), text);
  for (const std::string& note : notes) console.note(note);
}

}  // namespace isobrick::tools

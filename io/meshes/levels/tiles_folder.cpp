#include "io/meshes/levels/tiles_folder.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/digits.h"
#include "core/length_unit.h"
#include "io/bytes/output_file.h"
#include "io/meshes/gltf/meshopt_codec.h"
#include "io/meshes/levels/tile_content.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::string_view kTileset = "tileset.json", kTilesetPart = "tileset_", kJson = ".json",
                           kGlb = ".glb";

void make_folder(const fs::path& folder) {
  std::error_code failure;
  if (!fs::create_directory(folder, failure) && failure)
    throw system_error("create the folder", folder.string(), failure.value());
}

/// Whether a text is so many numbers with underscores between them.
bool are_numbers(std::string_view text, int count) {
  for (; count > 1; --count) {
    const std::size_t end = text.find('_');
    if (end == text.npos || !is_digits(text.substr(0, end))) return false;
    text.remove_prefix(end + 1);
  }
  return is_digits(text);
}

/// Whether a file belongs to the tileset of one mesh.
bool is_tileset_name(std::string_view name) {
  if (name == kTileset) return true;
  if (name.starts_with(kTilesetPart) && name.ends_with(kJson))
    return are_numbers(
        name.substr(kTilesetPart.size(), name.size() - kTilesetPart.size() - kJson.size()), 4);
  const std::size_t slash = name.find('/');
  return slash != name.npos && is_digits(name.substr(0, slash)) && name.ends_with(kGlb) &&
         are_numbers(name.substr(slash + 1, name.size() - slash - 1 - kGlb.size()), 3);
}

}  // namespace

/// Writes the files of a mesh.
class TilesFolder::Tileset final : public LevelWriter {
 public:
  Tileset(TilesFolder& folder, const Label& label, const MeshProperties& properties)
      : folder_(folder), label_(label), path_(folder.folder_of(label)) {
    form_.colour = properties.colour;
    form_.compress = folder.compress_;
  }

  LevelNeeds needs() const override { return {.normals = true, .errors = true}; }
  void begin(const MeshHeader& header) override {
    form_.normals = header.has_normals;
    form_.unit = header.unit;
  }
  std::string encode(const FragmentMesh& mesh, const FragmentPlace& place) const override {
    return tile_glb(mesh, place, form_);
  }
  void write(const FragmentPlace& place, std::string_view bytes) override {
    if (place.level != last_level_) make_folder(path_ / fmt::format("{}", place.level));
    last_level_ = place.level;
    write_new_file((path_ / TileTree::content_name(place.level, place.cell)).string(), bytes);
    bytes_ += bytes.size();
  }
  void finish(const ChunkGrid& grid, std::vector<EncodedLevel> levels) override {
    const double metres = unit_ratio(form_.unit, "meter").value_or(1);
    const TileTree tree(grid, levels, metres);
    bytes_ += tree.write(path_);
    MeshBounds bounds = tree.box().bounds();
    const Vec3d origin = Vec3d{grid.origin[0], grid.origin[1], grid.origin[2]} * metres;
    folder_.add_entry(label_, {TileBox({bounds.lo + origin, bounds.hi + origin}, 0), tree.error()},
                      bytes_);
  }
  std::uint64_t bytes() const override { return bytes_; }

 private:
  TilesFolder& folder_;
  Label label_;
  fs::path path_;
  TileForm form_;
  int last_level_ = -1;
  std::uint64_t bytes_ = 0;
};

TilesFolder::TilesFolder(fs::path folder, bool has_labels, bool compress)
    : folder_(std::move(folder)), has_labels_(has_labels), compress_(compress) {
  if (compress) check_meshopt();
}

fs::path TilesFolder::folder_of(const Label& label) const {
  return has_labels_ ? folder_ / label.text() : folder_;
}

std::string TilesFolder::file_of(const Label& label) const {
  return has_labels_ ? fmt::format("{}/{}", label.text(), kTileset) : std::string(kTileset);
}

std::unique_ptr<LevelSink> TilesFolder::add_mesh(const Label& label, const LevelOptions& options,
                                                 const MeshProperties& properties) {
  if (has_labels_) make_folder(folder_of(label));
  LevelOptions of_mesh = options;
  of_mesh.scratch_beside = folder_ / kTileset;
  return std::make_unique<DetailSink>(std::make_unique<Tileset>(*this, label, properties), of_mesh);
}

void TilesFolder::add_entry(const Label& label, const Entry& entry, std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  entries_.emplace(label, entry);
  bytes_ += bytes;
}

void TilesFolder::finish() {
  if (!has_labels_) return;
  MeshBounds bounds;
  double error = 0;
  ordered_json children = ordered_json::array();
  for (const auto& [label, entry] : entries_) {
    bounds = children.empty() ? entry.box.bounds() : united(bounds, entry.box.bounds());
    error = std::max(error, entry.error);
    ordered_json tile = tile_json(entry.box, entry.error);
    tile["content"] = {{"uri", file_of(label)}};
    children.push_back(std::move(tile));
  }
  const TileBox box(bounds, children.empty() ? 1 : 0);
  error = std::max(error, box.diagonal());
  ordered_json root = tile_json(box, error);
  root["refine"] = "REPLACE";
  if (!children.empty()) root["children"] = std::move(children);
  const std::string text = tileset_text(error, std::move(root));
  write_new_file((folder_ / kTileset).string(), text);
  bytes_ += text.size();
}

std::uint64_t TilesFolder::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

bool TilesFolder::is_own_name(std::string_view name) {
  if (is_tileset_name(name)) return true;
  const std::size_t slash = name.find('/');
  if (slash == name.npos) return false;
  std::string_view label = name.substr(0, slash);
  if (label.starts_with('-')) label.remove_prefix(1);
  return is_digits(label) && is_tileset_name(name.substr(slash + 1));
}

}  // namespace isobrick

#include "io/meshes/levels/neuroglancer_folder.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "io/bytes/output_file.h"
#include "io/meshes/levels/draco_mesh.h"
#include "io/meshes/levels/manifest.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::string_view kInfo = "info", kProperties = "segment_properties",
                           kPropertiesInfo = "segment_properties/info", kIndex = ".index",
                           kShard = ".shard";
bool consists_of(std::string_view text, std::string_view letters) {
  return !text.empty() && text.find_first_not_of(letters) == text.npos;
}

std::uint64_t write_text(const fs::path& path, const std::string& text) {
  OutputFile file(path.string(), false);
  file.writer().append(text);
  file.publish();
  return text.size();
}

std::string colour_text(const std::optional<std::array<std::uint8_t, 4>>& colour) {
  if (!colour) return {};
  return fmt::format("#{:02x}{:02x}{:02x}", (*colour)[0], (*colour)[1], (*colour)[2]);
}

/// As the manifest has levels: octrees are complete.
std::vector<ManifestLevel> manifest_of(const ChunkGrid& grid, std::vector<EncodedLevel> levels) {
  std::vector<ManifestLevel> manifest;
  for (EncodedLevel& level : levels) {
    // 0 would stand for a level that is not there.
    float scale = level.edge > 0 ? static_cast<float>(level.edge) : grid.edge;
    if (!manifest.empty()) scale = std::max(scale, manifest.back().scale);
    manifest.push_back({scale, std::move(level.fragments)});
  }
  // Readers take neither a segment without levels nor a level without fragments.
  if (manifest.empty()) manifest.push_back({.scale = 1});
  if (manifest.front().fragments.empty()) manifest.front().fragments.push_back({});
  complete_octree(manifest);
  return manifest;
}

}  // namespace

/// Writes the files of a segment.
class NeuroglancerFolder::Segment final : public LevelWriter {
 public:
  Segment(NeuroglancerFolder& folder, std::uint64_t id)
      : folder_(folder),
        id_(id),
        file_(folder.sharded_ ? nullptr : std::make_unique<OutputFile>(path(""), false)),
        scratch_(folder.sharded_ ? std::make_unique<FileWriter>(open_scratch_beside(path("")))
                                 : nullptr) {}

  LevelNeeds needs() const override { return {.halves = true}; }
  void begin(const MeshHeader& header) override { folder_.keep_unit(header.unit); }
  std::string encode(const FragmentMesh& mesh, const FragmentPlace&) const override {
    return encode_draco(mesh);
  }
  void write(const FragmentPlace&, std::string_view bytes) override { fragments().append(bytes); }
  void finish(const ChunkGrid& grid, std::vector<EncodedLevel> levels) override {
    const std::string manifest = manifest_bytes(grid, manifest_of(grid, std::move(levels)));
    manifest_bytes_ = manifest.size();
    if (scratch_) {
      folder_.add_shard_entry(id_, *scratch_, manifest);
      return;
    }
    const std::uint64_t bytes = file_->writer().size();
    file_->publish();
    folder_.add_bytes(bytes + write_text(path(kIndex), manifest));
  }
  std::uint64_t bytes() const override { return fragments().size() + manifest_bytes_; }

 private:
  std::string path(std::string_view extension) const {
    return (folder_.folder_ / fmt::format("{}{}", id_, extension)).string();
  }
  FileWriter& fragments() const { return file_ ? file_->writer() : *scratch_; }

  NeuroglancerFolder& folder_;
  std::uint64_t id_, manifest_bytes_ = 0;
  std::unique_ptr<OutputFile> file_;     ///< of fragments; null in shards
  std::unique_ptr<FileWriter> scratch_;  ///< in its place in shards
};

NeuroglancerFolder::NeuroglancerFolder(fs::path folder, bool sharded)
    : folder_((check_draco(), std::move(folder))),
      sharded_(sharded),
      collected_(open_scratch_beside((folder_ / kInfo).string())) {}

std::unique_ptr<LevelSink> NeuroglancerFolder::add_mesh(const Label& label,
                                                        const LevelOptions& options,
                                                        const MeshProperties& properties) {
  const auto number = label.as_unsigned();
  if (!number)
    throw UsageError(
        fmt::format("neuroglancer has no negative segments such as {}: leave them out of --labels",
                    label.text()));
  const std::uint64_t id = *number;
  {
    const std::lock_guard lock(mutex_);
    properties_[id] = properties;
  }
  LevelOptions of_segment = options;
  of_segment.scratch_beside = folder_ / kInfo;
  return std::make_unique<DetailSink>(std::make_unique<Segment>(*this, id), of_segment);
}

std::string NeuroglancerFolder::file_of(const Label& label) const {
  return sharded_ ? std::string() : label.text();
}

void NeuroglancerFolder::keep_unit(const std::string& unit) {
  const std::lock_guard lock(mutex_);
  unit_ = unit;
}

void NeuroglancerFolder::add_bytes(std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  bytes_ += bytes;
}

void NeuroglancerFolder::add_shard_entry(std::uint64_t id, FileWriter& fragments,
                                         const std::string& manifest) {
  const std::lock_guard lock(mutex_);
  entries_[id] = {collected_.size(), fragments.size(), manifest.size()};
  collected_.append_file(fragments);
  collected_.append(manifest);
}

void NeuroglancerFolder::finish() {
  std::optional<ShardBits> bits;
  if (sharded_) {
    bits = choose_shard_bits(entries_.size(), collected_.size());
    bytes_ += write_shards(folder_, collected_, entries_, *bits);
  }
  collected_.release();
  write_properties();
  write_info(bits);
}

void NeuroglancerFolder::write_info(std::optional<ShardBits> bits) {
  // neuroglancer counts in nanometres.
  const double scale = unit_.empty() ? 1 : unit_ratio(unit_, "nanometer").value_or(1);
  ordered_json info{{"@type", "neuroglancer_multilod_draco"},
                    {"vertex_quantization_bits", 16},
                    {"transform", {scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0}},
                    {"lod_scale_multiplier", 1},
                    {"segment_properties", kProperties}};
  if (bits)
    info["sharding"] = {{"@type", "neuroglancer_uint64_sharded_v1"},
                        {"preshift_bits", 0},
                        {"hash", "murmurhash3_x86_128"},
                        {"minishard_bits", bits->minishard},
                        {"shard_bits", bits->shard},
                        {"minishard_index_encoding", "raw"},
                        {"data_encoding", "raw"}};
  bytes_ += write_text(folder_ / kInfo, info.dump() + "\n");
}

void NeuroglancerFolder::write_properties() {
  ordered_json ids = ordered_json::array(), names = ids, colours = ids;
  bool has_names = false, has_colours = false;
  for (const auto& [id, properties] : properties_) {
    ids.push_back(fmt::format("{}", id));
    names.push_back(properties.name);
    colours.push_back(colour_text(properties.colour));
    has_names = has_names || !properties.name.empty();
    has_colours = has_colours || properties.colour.has_value();
  }
  ordered_json properties = ordered_json::array();
  if (has_names)
    properties.push_back({{"id", "name"}, {"type", "label"}, {"values", std::move(names)}});
  if (has_colours)
    properties.push_back({{"id", "colour"}, {"type", "string"}, {"values", std::move(colours)}});
  const ordered_json info{
      {"@type", "neuroglancer_segment_properties"},
      {"inline", {{"ids", std::move(ids)}, {"properties", std::move(properties)}}}};
  std::error_code failure;
  if (!fs::create_directory(folder_ / kProperties, failure) && failure)
    throw system_error("create the folder", (folder_ / kProperties).string(), failure.value());
  bytes_ += write_text(folder_ / kPropertiesInfo, info.dump() + "\n");
}

std::uint64_t NeuroglancerFolder::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

bool NeuroglancerFolder::is_own_name(std::string_view name) {
  constexpr std::string_view decimal = "0123456789", hexadecimal = "0123456789abcdef";
  if (name == kInfo || name == kPropertiesInfo) return true;
  if (name.ends_with(kShard))
    return consists_of(name.substr(0, name.size() - kShard.size()), hexadecimal);
  if (name.ends_with(kIndex)) name.remove_suffix(kIndex.size());
  return consists_of(name, decimal);
}

}  // namespace isobrick

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/brick_codec.h>
#include <isobrick/downsampling.h>
#include <isobrick/image_metadata.h>
#include <isobrick/level_info.h>
#include <isobrick/sample_value.h>
#include "bricks/zarr/array_metadata.h"
#include "bricks/zarr/codec.h"

namespace isobrick::inline v0 {

/// Everything that the metadata of a store will hold. All levels share type and codec.
struct StoreLayout {
  std::vector<LevelInfo> levels;
  std::vector<Int3> factors;  ///< of each level but the last: 1 or 2 an axis, to the next one
  Downsampling downsampling = Downsampling::mean;  ///< what makes the coarser levels
  OmeVersion ome = OmeVersion::v05;                ///< in 0.4 every shard is one brick
  BrickCodec codec = BrickCodec::zstd;
  int zstd_level = 3;
  SampleValue fill_value;
  bool may_have_nan = false;
  std::string name;
  std::string grid_class;            ///< as OpenVDB calls it, or empty
  std::string grid_name;             ///< of the OpenVDB grid, or empty
  std::optional<LabelTable> labels;  ///< as VolumeInfo::labels
  /// Of a store that is written once more: the text of its root's file, which is kept but for the
  /// checksum. The members above state the same. Empty: the file is made of them.
  std::string root;

  CodecChain codecs() const { return CodecChain::of(codec, zstd_level, ome == OmeVersion::v04); }
};

/// Throws UsageError or Error for a layout that no store can have.
void check_layout(const StoreLayout& layout);

/// The metadata of a level's array, and of the image; the latter without what is known only when
/// the samples are.
ArrayMetadata array_metadata(const LevelInfo& level, const StoreLayout& layout);
ImageMetadata image_metadata(const StoreLayout& layout);

/// The text of kLayoutMarker, which a resume compares: all metadata but may_have_nan, which is
/// known last.
std::string layout_marker(const StoreLayout& layout);

/// Throws Error when `marker`, the text of an interrupted conversion, has another layout. `file`
/// and `store` are how messages name the marker and its folder.
void check_same_layout(std::string_view marker, const StoreLayout& layout, const std::string& file,
                       const std::string& store);

/// The file whose presence makes a folder a store.
struct RootFile {
  const char* name;
  std::string json;
};
RootFile root_file(const ImageMetadata& image, const StoreLayout& layout);

/// metadata_checksum() of the metadata that a reader of the store will find. `where` names the
/// root's file.
std::uint32_t layout_checksum(const ImageMetadata& image, const StoreLayout& layout,
                              const std::string& where);

}  // namespace isobrick

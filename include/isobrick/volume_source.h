#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/label_properties.h>
#include <isobrick/sample_value.h>
#include <isobrick/scalar.h>
#include <isobrick/transform.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// What is known of a volume before any sample is read.
struct VolumeInfo {
  Int3 extent;                       ///< samples along x, y, z
  ScalarType type = ScalarType::u8;  ///< of the samples
  Transform transform;               ///< index space to world space
  std::string name;        ///< for messages and metadata: the path, "standard input", "gyroid"
  SampleValue fill_value;  ///< what absent bricks hold: the value of empty space
  std::string grid_class;  ///< what OpenVDB calls it: "level set", "fog volume", …; or empty
  std::string grid_name;   ///< of the OpenVDB grid that it is, or empty
  /// Of a label image: what is known of its labels, of some or of none. Nothing: it is no label
  /// image, or does not say so.
  std::optional<LabelTable> labels = {};
  /// All files that it is read from, headers included; none of a volume that is computed or comes
  /// from a stream.
  std::vector<std::filesystem::path> files;
};

/// A volume that can be read piece by piece. Never holds the whole of it.
class ISOBRICK_API VolumeSource {
 public:
  virtual ~VolumeSource() = default;

  /// What is known before any sample is read. Valid as long as the source.
  virtual const VolumeInfo& info() const = 0;

  /// True when boxes may be read in any order, each as often as one likes.
  /// Otherwise only whole planes [0,X)×[0,Y)×[z0,z1) with increasing z may be
  /// requested, each once, from one thread.
  virtual bool random_access() const = 0;

  /// Of a source with random access: true when several threads may read at once.
  virtual bool parallel() const { return random_access(); }

  /// Bytes of memory that the source takes for itself at most, beside the
  /// requested samples; budgets count them.
  virtual std::size_t memory() const { return 0; }

  /// True of a source with random access most of which may be the fill value;
  /// is_fill() is then fast.
  virtual bool sparse() const { return false; }

  /// True when every sample of `box` is known, without looking at each, to be
  /// the fill value; false means unknown. Thread-safe.
  virtual bool is_fill(Box3) const { return false; }

  /// The value of all samples of `box`, when it is known, without looking at each, that
  /// they have the same: one sample of the volume's type, in the first of eight bytes, the
  /// rest zero. nullopt means unknown. Thread-safe.
  virtual std::optional<std::uint64_t> constant(Box3) const { return std::nullopt; }

  /// Copies the samples of `box` to `out`, C order [z, y, x], native byte
  /// order. `box` lies inside the extent; `out` has room for it.
  /// Throws Error naming the file and the offset on a short or failed read.
  virtual void read(Box3 box, std::byte* out) = 0;

  /// Remarks about the file for its user, a sentence each: what is ignored of it. A stream has
  /// them only when its last plane was read.
  virtual std::vector<std::string> notes() const { return {}; }

  /// Hints that `box` is read soon; may start the disk. Does nothing by default.
  virtual void will_need(Box3) {}
};

}  // namespace isobrick

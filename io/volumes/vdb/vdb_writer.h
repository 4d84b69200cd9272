#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include <isobrick/volume_source.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// An OpenVDB grid that grows box by box. It is held in OpenVDB's sparse form:
/// samples that are `info.fill_value` take no room, constant cubes hardly any.
class VdbWriter {
 public:
  virtual ~VdbWriter() = default;

  /// The samples of `box`, dense in C order; boxes do not overlap. What is never
  /// put is the fill value. Throws UsageError when the grid outgrows its budget.
  virtual void put(Box3 box, const std::byte* samples) = 0;

  /// Writes the grid as all of `file`, to be published. Throws Error when that fails.
  virtual void write(OutputFile& file) = 0;
};

/// A grid named `name` of the volume's type (integers of less than 32 bits become
/// int32, u32 becomes int64), with its transform and class. Samples that are not
/// the fill value are active, and so are the volume's first and last one: the
/// box of active voxels is the volume's. It may take `budget` bytes.
std::unique_ptr<VdbWriter> make_vdb_writer(const VolumeInfo& info, const std::string& name,
                                           std::uint64_t budget);

/// The same where OpenVDB was missing when this was built: throws UsageError.
std::unique_ptr<VdbWriter> make_vdb_writer_if_built(const VolumeInfo& info, const std::string& name,
                                                    std::uint64_t budget);

}  // namespace isobrick

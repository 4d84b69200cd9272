#pragma once

#include <memory>
#include <string>

#include "isobrick/volumes/vdb_writer.h"
#include "isobrick/volumes/volume_request.h"

namespace isobrick {

/// What the module has that knows OpenVDB. It is loaded when it is first needed:
/// to link OpenVDB's library takes longer than most commands.
struct VdbModule {
  const char* version;  ///< of isobrick; another one's module is of no use
  std::unique_ptr<VolumeSource> (*open)(const std::string& file, const VolumeRequest& said);
  std::unique_ptr<VdbWriter> (*make_writer)(const VolumeInfo& info, const std::string& name);
};

/// The module's one symbol, a `const VdbModule* ()`.
inline constexpr const char* kVdbModuleSymbol = "isobrick_openvdb_module";

/// Loads the module, once. Throws Error when it is not where it belongs.
const VdbModule& vdb_module();

}  // namespace isobrick

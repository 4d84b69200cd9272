#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <isobrick/mesh.h>
#include "viewer/render/preview_options.h"

// Pictures, or their refusal in a program that was built without OpenGL.
namespace isobrick::tools {

/// The sink behind --preview. Throws UsageError in a program without pictures.
std::unique_ptr<MeshSink> open_preview(const std::string& path, bool force,
                                       const PreviewOptions& options);

/// MeshSink::memory() of such a sink, and what OpenGL's driver takes besides for all of them, from
/// when the first is opened. Throw as open_preview does.
std::uint64_t preview_memory(const PreviewOptions& options);
std::uint64_t preview_driver_memory();

}  // namespace isobrick::tools

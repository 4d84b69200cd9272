#include "tools/pictures.h"

#include "viewer/render/preview_sink.h"

namespace isobrick::tools {

std::unique_ptr<MeshSink> open_preview(const std::string& path, bool force,
                                       const PreviewOptions& options) {
  return std::make_unique<PreviewSink>(path, force, options);
}

std::uint64_t preview_memory(const PreviewOptions& options) {
  return PreviewSink::memory_with(options);
}

std::uint64_t preview_driver_memory() { return Renderer::driver_memory(0); }

}  // namespace isobrick::tools

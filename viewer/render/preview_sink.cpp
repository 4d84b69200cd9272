#include "viewer/render/preview_sink.h"

#include "io/bytes/png_file.h"

namespace isobrick::inline v0 {
namespace {

PictureSinkOptions sink_options(const PreviewOptions& options) {
  return {.width = options.width, .height = options.height, .camera = options.camera};
}

}  // namespace

PreviewSink::PreviewSink(std::string path, bool force, const PreviewOptions& options)
    : options_(options), out_(std::move(path), force), picture_(sink_options(options)) {
  picture_.set_style({.colour = options.colour});
}

std::uint64_t PreviewSink::memory_with(const PreviewOptions& options) {
  return PictureSink::memory_with(sink_options(options));
}

void PreviewSink::finish() {
  picture_.finish();
  write_png(out_, options_.width, options_.height, without_alpha(picture_.end()));
}

}  // namespace isobrick

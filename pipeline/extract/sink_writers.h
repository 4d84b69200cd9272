#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include <isobrick/mesh.h>

namespace isobrick::inline v0 {

/// Writes a mesh to each sink at the same time and finishes the sinks. `write` is called with a
/// sink's number and the sink to write to, each time on another thread. `written` is called on the
/// calling thread, some twenty times a second, with a sink's number and the bytes that it took
/// since the last call. When either throws, the other writes end with their next chunk, their sinks
/// unfinished, and the first error is rethrown.
void write_together(std::span<MeshSink* const> sinks,
                    const std::function<void(std::size_t, MeshSink&)>& write,
                    const std::function<void(std::size_t, std::uint64_t)>& written);

}  // namespace isobrick

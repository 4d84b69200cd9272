#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/index_choice.h>
#include <isobrick/inside.h>
#include <isobrick/mesh.h>
#include <isobrick/progress.h>
#include <isobrick/store_reader.h>
#include <isobrick/surface_report.h>
#include <isobrick/topology.h>

namespace isobrick::inline v0 {

/// What makes the surface. The mesh is the same.
enum class Backend : std::uint8_t {
  automatic,  ///< the GPU where there is one that is expected to be faster
  cpu,
  cuda,
};

/// Which surface, from which part of a store, and with what means.
struct ExtractOptions {
  double isovalue = 0;                ///< in the values of the samples
  int level = 0;                      ///< 0: the finest
  std::optional<Box3> roi = {};       ///< samples of that level; nothing: the whole volume
  std::optional<Inside> inside = {};  ///< nothing: below the isovalue in a level set, else above
  bool normals = false;               ///< gradient normals
  bool drop_degenerate = false;       ///< see SurfaceOptions
  Topology topology = Topology::consistent;       ///< how ambiguous cells are resolved
  bool cap = false;                               ///< see SurfaceOptions
  std::uint64_t memory = std::uint64_t{1} << 30;  ///< hard budget, bytes
  /// Of the budget of the whole command what others take; messages name both together.
  std::uint64_t memory_of_others = 0;
  int threads = 0;                       ///< 0: all cores
  IndexChoice index = {};                ///< how active blocks are found; never shows in the mesh
  Backend backend = Backend::automatic;  ///< what makes the surface
  std::uint64_t gpu_memory = 0;  ///< hard budget of device memory, bytes; 0: what is free less 10 %
  int device = 0;                ///< of the CUDA devices, the first is 0
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
};

/// One of several surfaces that are extracted together, and the sink that takes it.
struct SurfaceOutput {
  double isovalue = 0;       ///< in the values of the samples
  bool normals = false;      ///< gradient normals
  MeshSink* sink = nullptr;  ///< one for each surface
};

/// What an extraction did. Of surfaces that were made in one pass over the store, what the pass
/// read, decoded, searched for and waited for is in each one's report.
struct ExtractReport : SurfaceReport {
  std::size_t pass = 0;             ///< which pass made the surface, the first is 0
  std::uint64_t bricks = 0;         ///< of the level
  std::uint64_t active_bricks = 0;  ///< with a block that the isovalue touches
  std::uint64_t bricks_read = 0;    ///< different bricks that were read
  std::uint64_t brick_reads = 0;  ///< reads of bricks; more than bricks_read where one was repeated
  std::uint64_t bytes_read = 0;   ///< from disk
  double seconds = 0;             ///< wall time of all
  /// Wall time of counting active blocks, planning and opening the device.
  double plan_seconds = 0;
  double decode_seconds = 0;   ///< wall time of waiting for decoded bricks
  double surface_seconds = 0;  ///< wall time in which the surface was made
  /// That found the active blocks; none: ranges alone did, as for capped surfaces.
  std::optional<IndexKind> index;
  std::string backend = "cpu";  ///< or "cuda"
  std::string device;           ///< its name, of the latter
  /// The surface was made from samples that stayed on the device, beside its mesh.
  bool resident = false;
  /// Why the GPU, which Backend::automatic chose, left the surface to the CPU; or empty.
  std::string gpu_refusal;
  StageReport read;                       ///< encoded bricks
  StageReport decode;                     ///< decoded bricks
  std::uint64_t device_bytes_in_use = 0;  ///< by all surfaces of the pass, as the driver counts it
  std::uint64_t pool_bricks = 0;   ///< that the device has room for; 0: bricks lie in host memory
  std::uint64_t search_bytes = 0;  ///< read to find the active blocks, once
  double search_seconds = 0;       ///< to find them, once
};

/// The stages that there were, by name.
ISOBRICK_API std::vector<std::pair<std::string_view, StageReport>> stages_of(
    const ExtractReport& report);

/// The stage that was busy longest.
ISOBRICK_API std::string_view bound_of(const ExtractReport& report);

/// The least `memory` that extract() takes without a GPU, for a sink of this indexing that holds
/// `sink_bytes` (MeshSink::memory()). Throws as it does for options that make no sense.
ISOBRICK_API std::uint64_t min_extract_memory(const StoreReader& store,
                                              const ExtractOptions& options, Indexing indexing,
                                              std::uint64_t sink_bytes);

/// Streams the isosurface of one level into `sink` (begin … finish).
/// Throws UsageError for a level, ROI or isovalue that makes no sense, a budget too small
/// for one tile with its neighbours, or a surface that Backend::cuda cannot make; Error where
/// there is no CUDA device for it. Backend::automatic takes the CPU where the GPU cannot.
ISOBRICK_API ExtractReport extract(const StoreReader& store, const ExtractOptions& options,
                                   MeshSink& sink, Progress& progress = no_progress());
/// The same into memory: a welded mesh, which the budget does not count.
ISOBRICK_API Mesh extract(const StoreReader& store, const ExtractOptions& options,
                          Progress& progress = no_progress());

/// Streams several surfaces of one level, each into its sink, and reads and decodes every brick
/// once for all of them. Bricks that any isovalue touches are visited once, in the order of a
/// single extraction. Isovalues may repeat, for a mesh and its picture. Every sink gets what it
/// would get alone. `isovalue` and `normals` of the options do not matter.
///
/// The budgets hold for all surfaces together. Where they have no room for all, the surfaces are
/// made in several passes over the store, in their order, each of as many as fit. The budget of
/// the one that needs most is enough. Begins the sinks of a pass before it and finishes them after
/// it.
///
/// On a GPU whose memory has room for all samples that the surfaces touch, these stay there. That
/// takes several isovalues and sinks of welded meshes, which then get all vertices before the
/// triangles. A sink begins when its mesh is made. Several sinks are written and finished at the
/// same time, each on a thread of its own.
///
/// Throws as above: for options that make no sense, and for a `memory` too small for one of the
/// surfaces on the CPU, before any sink begins. A report for each surface.
ISOBRICK_API std::vector<ExtractReport> extract(const StoreReader& store,
                                                const ExtractOptions& options,
                                                std::span<const SurfaceOutput> outputs,
                                                Progress& progress = no_progress());

}  // namespace isobrick

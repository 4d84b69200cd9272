#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/label.h>
#include <isobrick/mesh.h>
#include <isobrick/progress.h>
#include <isobrick/store_reader.h>
#include <isobrick/volume.h>

namespace isobrick::inline v0 {

/// The labels from `first` to `last`, both included.
struct LabelRange {
  Label first = 0;  ///< the smallest label
  Label last = 0;   ///< the largest label
};

/// What the meshes of all labels are together.
struct LabelTotals {
  std::uint64_t labels = 0;  ///< that have a mesh
  MeshSize size;             ///< of all meshes
  MeshSize largest;          ///< the most vertices, and the most triangles, of one mesh
};

/// Which labels of a label image get a mesh, and with what means.
struct LabelOptions {
  std::vector<LabelRange> labels = {};  ///< none: all but `background`
  Label background = 0;                 ///< no object, unless `labels` names it
  int level = 0;                        ///< 0: the finest
  /// Iterations of Taubin's λ|μ smoothing, at most 6. All meshes are smoothed together, so walls
  /// still coincide, and no vertex leaves its cell.
  int smooth = 0;
  double pass_band = 0.1;        ///< of the smoothing, see MeshFilterOptions
  std::optional<Box3> roi = {};  ///< samples of that level; nothing: the whole volume
  /// Hard budget of the pass, bytes. Meshes are passed on after it; then a quarter is still taken
  /// at most.
  std::uint64_t memory = std::uint64_t{1} << 30;
  int threads = 0;  ///< 0: all cores
  /// Where some labels are chosen and the store has lists of labels (add_label_index()), only
  /// tiles that have one of them are looked at.
  bool use_lists = true;
  int visits = 0;  ///< meshes that are passed on at the same time; 0: as many as threads
  /// The file or folder beside which the scratch file lies; "-": in the folder of temporary files.
  std::filesystem::path scratch_beside = "-";
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
  /// Called once, before the first mesh is passed on. What it throws ends the operation.
  std::function<void(const LabelTotals&)> check_totals = {};
};

/// The mesh of one label.
class ISOBRICK_API LabelMesh {
 public:
  virtual ~LabelMesh() = default;

  virtual Label label() const = 0;  ///< the samples' value
  /// Its place among all meshes in the order of the labels, the first is 0.
  virtual std::uint64_t index() const = 0;
  virtual MeshSize size() const = 0;  ///< vertices and triangles
  /// Passes the mesh to a sink (begin … finish), each time the same.
  virtual void write(MeshSink& sink) const = 0;
};

/// Takes the meshes, each once. Several threads may call it at the same time, for different labels.
/// What it throws ends the operation.
using LabelVisitor = std::function<void(const LabelMesh& mesh)>;

/// What an extraction of labels did.
struct LabelReport {
  std::uint64_t labels = 0;         ///< that have a mesh
  std::uint64_t vertices = 0;       ///< of all meshes
  std::uint64_t triangles = 0;      ///< of all meshes
  std::uint64_t bricks = 0;         ///< of the level
  std::uint64_t bricks_read = 0;    ///< different bricks that were read
  std::uint64_t brick_reads = 0;    ///< reads of bricks; more where one was repeated
  std::uint64_t bytes_read = 0;     ///< from disk
  std::uint64_t index_bytes = 0;    ///< read from lists of labels; 0: these were not used
  std::uint64_t scratch_bytes = 0;  ///< of the scratch file
  double seconds = 0;               ///< wall time of all
  double write_seconds = 0;         ///< part of it in which the meshes were passed on
};

/// Makes a closed mesh of every label that `options` chooses and the region has, in one pass over
/// the bricks, whatever the number of labels: surface nets (Gibson, "Constrained elastic surface
/// nets", 1998). A vertex is the mean of the middles of the edges of a cell that join samples of
/// different labels. Where two labels meet both meshes have the same triangles, oppositely
/// oriented. Samples belong together that are neighbours along an axis. At the border of the region
/// objects end half a sample beyond their last one.
///
/// Each mesh is a closed manifold and depends on the volume, the level and the region alone, not
/// on the other labels that are chosen. Memory grows with the number of labels, by 420 bytes each
/// at most, and not with the meshes, which wait in a scratch file.
///
/// Samples must be whole numbers, floating-point ones 2⁵³ at most. NaN has no label. Calls `visit`
/// with the labels in about ascending order, after the pass. Throws UsageError for a level, region
/// or range of labels that makes no sense, a label not there, a budget too small; Error where a
/// sample is no label.
ISOBRICK_API LabelReport extract_labels(const StoreReader& store, const LabelOptions& options,
                                        const LabelVisitor& visit,
                                        Progress& progress = no_progress());
/// The same of samples in memory, which are read in place, or behind a function.
ISOBRICK_API LabelReport extract_labels(const Volume& volume, const LabelOptions& options,
                                        const LabelVisitor& visit,
                                        Progress& progress = no_progress());

}  // namespace isobrick

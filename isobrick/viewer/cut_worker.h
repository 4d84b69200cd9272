#pragma once

#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "isobrick/viewer/node_search.h"
#include "isobrick/viewer/scene_stream.h"

namespace isobrick {

/// What a cut is a function of, beside the cut before.
struct CutRequest {
  std::vector<double> isovalues;
  View view;
  CutBudget budget;
  friend bool operator==(const CutRequest&, const CutRequest&) = default;
};

/// Seconds that the steps of a cut took its thread.
struct CutTimes {
  double search = 0;  ///< finding the nodes that isovalues cross
  double cut = 0;     ///< choosing nodes
  double plan = 0;    ///< handing them to the stream
};

/// Chooses cuts on a thread of its own and hands them to a stream, so that who draws need not wait
/// for them. For one thread.
class CutWorker {
 public:
  /// Borrows all three. `search` is asked by this worker alone.
  CutWorker(const NodeTree& tree, NodeSearch& search, SceneStream& stream);
  /// Waits for a cut that is being chosen.
  ~CutWorker();

  /// From now on the stream is to make this, and not what was asked for before and has not been
  /// begun.
  void ask(CutRequest request);
  /// Waits at most so many seconds until what was asked for last is handed over; whether it is.
  /// Throws what went wrong with it.
  bool wait(double seconds);

  /// The cut that was handed over last; never null.
  std::shared_ptr<const Cut> cut() const;
  /// What could be drawn of the cut before, just before the next one is handed over; null
  /// since wait() was true. Until then the stream itself may take its time to say.
  std::shared_ptr<const Drawable> before() const;
  CutTimes times() const;

 private:
  void run();
  void choose(const CutRequest& request);
  void look_before();

  NodeSearch& search_;
  SceneStream& stream_;

  mutable std::mutex mutex_;
  mutable std::condition_variable change_;
  bool stop_ = false, choosing_ = false;
  std::optional<CutRequest> asked_;
  std::shared_ptr<const Cut> cut_ = std::make_shared<const Cut>();
  std::shared_ptr<const Drawable> before_;
  CutTimes times_;
  std::exception_ptr failure_;

  // Of the thread alone.
  const NodeTree& tree_;
  std::optional<CutSelector> selector_;
  std::optional<CutRequest> chosen_;

  std::thread thread_;
};

}  // namespace isobrick

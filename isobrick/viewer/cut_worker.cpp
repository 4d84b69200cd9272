#include "isobrick/viewer/cut_worker.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "isobrick/core/stopwatch.h"

namespace isobrick {
namespace {

bool same_cut(const Cut& a, const Cut& b) {
  return a.isovalues == b.isovalues &&
         std::equal(a.nodes.begin(), a.nodes.end(), b.nodes.begin(), b.nodes.end(),
                    [](const CutNode& p, const CutNode& q) {
                      return p.key == q.key && p.coarser == q.coarser && p.visible == q.visible &&
                             p.cut_away == q.cut_away;
                    });
}

}  // namespace

CutWorker::CutWorker(const NodeTree& tree, NodeSearch& search, SceneStream& stream)
    : search_(search), stream_(stream), tree_(tree), thread_([this] { run(); }) {}

CutWorker::~CutWorker() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  change_.notify_all();
  thread_.join();
}

void CutWorker::ask(CutRequest request) {
  {
    const std::lock_guard lock(mutex_);
    asked_ = std::move(request);
  }
  change_.notify_all();
}

bool CutWorker::wait(double seconds) {
  std::unique_lock lock(mutex_);
  const auto done = [&] { return !asked_ && !choosing_; };
  if (std::isinf(seconds))
    change_.wait(lock, done);
  else if (seconds > 0)
    change_.wait_for(lock, std::chrono::duration<double>(seconds), done);
  if (!done()) return false;
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  const auto dropped = std::exchange(before_, nullptr);  // its meshes are in nobody's budget
  lock.unlock();
  return true;
}

std::shared_ptr<const Cut> CutWorker::cut() const {
  const std::lock_guard lock(mutex_);
  return cut_;
}

std::shared_ptr<const Drawable> CutWorker::before() const {
  const std::lock_guard lock(mutex_);
  return before_;
}

CutTimes CutWorker::times() const {
  const std::lock_guard lock(mutex_);
  return times_;
}

void CutWorker::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    change_.wait(lock, [&] { return stop_ || asked_; });
    if (stop_) return;
    const CutRequest request = *std::exchange(asked_, std::nullopt);
    choosing_ = true;
    failure_ = nullptr;
    lock.unlock();
    std::exception_ptr failure;
    try {
      choose(request);
    } catch (...) {
      failure = std::current_exception();
      selector_.reset();  // it may have stopped half way
    }
    lock.lock();
    choosing_ = false;
    failure_ = failure;
    change_.notify_all();
  }
}

void CutWorker::choose(const CutRequest& request) {
  Stopwatch watch;
  CutTimes times;
  const ActiveNodes& active = search_.find(request.isovalues);
  times.search = watch.lap();
  std::shared_ptr<const Cut> next;
  if (chosen_ != request) {
    chosen_.reset();
    if (!selector_) selector_.emplace(tree_);
    next = std::make_shared<const Cut>(selector_->select(active, request.view, request.budget));
    if (same_cut(*next, *cut_)) next.reset();
    times.cut = watch.lap();
  }
  if (next) {
    look_before();
    watch.lap();
    stream_.set_cut(*next);
    times.plan = watch.lap();
  }
  chosen_ = request;
  const std::lock_guard lock(mutex_);
  times_ = times;
  if (next) cut_ = std::move(next);
}

void CutWorker::look_before() {
  auto drawable = stream_.drawable();
  const std::lock_guard lock(mutex_);
  std::swap(before_, drawable);  // the older one goes without the lock
}

}  // namespace isobrick

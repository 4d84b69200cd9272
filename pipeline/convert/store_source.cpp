#include "pipeline/convert/store_source.h"

#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <utility>
#include <vector>

#include <isobrick/open_source.h>
#include <isobrick/store_reader.h>
#include "bricks/zarr/metadata_files.h"
#include "io/volumes/selected_source.h"
#include "pipeline/slab_reader.h"

namespace isobrick::inline v0 {
namespace {

class StoreSource final : public VolumeSource {
 public:
  StoreSource(const std::string& path, const VolumeRequest& request, int threads,
              const RemoteOptions& remote)
      : store_(StoreReader(open_storage(path, remote), request.selection).native()),
        threads_(threads > 0 ? threads : tbb::info::default_concurrency()),
        arena_(threads_) {
    const LevelInfo& finest = store_.info().levels.front();
    info_ = describe_volume(path, finest.lattice.extent, finest.lattice.type, finest.transform,
                            request);
    info_.fill_value = store_.info().fill_value;
    info_.grid_class = store_.info().grid_class;
    info_.grid_name = store_.info().grid_name;
    info_.labels = store_.info().labels;
    if (store_.storage()->is_remote()) info_.files.clear();
  }

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  // A read takes all threads itself. Small pieces read side by side would each
  // decode the whole chunks that they have a part of.
  bool parallel() const override { return false; }
  std::size_t memory() const override {
    return static_cast<std::size_t>(slab_memory(store_.info(), 0, threads_));
  }
  void will_need(Box3 box) override {
    if (!store_.storage()->is_remote()) return;
    const Int3 brick = store_.info().levels.front().lattice.brick;
    std::vector<Int3> bricks;
    for_each_point({floor_div(box.lo, brick), ceil_div(box.hi, brick)},
                   [&](Int3 b) { bricks.push_back(b); });
    store_.will_need(0, bricks);
  }
  void read(Box3 box, std::byte* out) override {
    will_need(box);  // its requests overlap
    arena_.execute([&] { read_slab(store_, 0, box, out); });
  }

 private:
  StoreReader store_;
  int threads_;
  tbb::task_arena arena_;
  VolumeInfo info_;
};

}  // namespace

std::unique_ptr<VolumeSource> open_store_source(const std::string& path,
                                                const VolumeRequest& request, int threads,
                                                const RemoteOptions& remote) {
  refuse_raw_description(path, "Zarr", request);
  return select_samples(std::make_unique<StoreSource>(path, request, threads, remote), request);
}

std::unique_ptr<VolumeSource> open_any_source(const std::string& path, const VolumeRequest& request,
                                              const RemoteOptions& remote) {
  if (!is_zarr(path)) return open_source(path, request);
  refuse_grid(path, request);
  return open_store_source(path, request, request.threads, remote);
}

}  // namespace isobrick

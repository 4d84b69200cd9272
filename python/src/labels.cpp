#include "python/src/labels.h"

#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include <isobrick/mesh_sinks.h>
#include "python/src/casters.h"

namespace isobrick::python {

py::dict label_meshes(const py::object& callback, const MakeLabelMeshes& make) {
  std::map<Label, std::unique_ptr<Mesh>> meshes;
  run_interruptibly(callback, [&](Reporter reporter) {
    std::mutex mutex;
    make(
        [&](const LabelMesh& label) {
          auto mesh = std::make_unique<Mesh>();
          MemorySink sink(*mesh);
          label.write(sink);
          const std::lock_guard lock(mutex);
          meshes.emplace(label.label(), std::move(mesh));
        },
        reporter);
  });
  py::dict result;
  for (auto& [label, mesh] : meshes) result[py::cast(label)] = py::cast(std::move(mesh));
  return result;
}

}  // namespace isobrick::python

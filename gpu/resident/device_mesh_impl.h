#pragma once

#include <string>

#include <isobrick/device_mesh.h>
#include <isobrick/device_volume.h>
#include "gpu/resident/resident_launcher.h"

namespace isobrick::inline v0 {

struct DeviceMesh::Impl {
  int device;
  gpu::Stream stream;
  gpu::MeshRoom room;
  gpu::DeviceCounts counts;
  std::string unit;
  gpu::Event ready{cudaEventDisableTiming};

  Impl(int d, const gpu::Stream& s, gpu::MeshRoom r, const gpu::DeviceCounts& c, std::string u);
  ~Impl();
};

}  // namespace isobrick

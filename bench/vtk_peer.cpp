#include "bench/vtk_peer.h"

#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkSMPTools.h>
#include <vtkSmartPointer.h>
#include <vtkVersion.h>

#include <chrono>

#include "bench/vtk_volume.h"

namespace isobrick::bench {
struct VtkPeer::Impl {
  vtkNew<vtkImageData> image;
};

VtkPeer::VtkPeer(std::int64_t x, std::int64_t y, std::int64_t z, int type, void* samples)
    : impl_(std::make_unique<Impl>()) {
  show_samples(impl_->image, x, y, z, type, samples);
}

VtkPeer::~VtkPeer() = default;

VtkPeer::Result VtkPeer::run(double isovalue, bool normals, int threads) {
  vtkSMPTools::SetBackend("TBB");
  vtkSMPTools::Initialize(threads);
  vtkNew<vtkFlyingEdges3D> filter;
  filter->SetInputData(impl_->image);
  filter->SetValue(0, isovalue);
  filter->SetComputeNormals(normals);
  filter->SetComputeGradients(false);
  filter->SetComputeScalars(false);
  const auto start = std::chrono::steady_clock::now();
  filter->Update();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  vtkPolyData* mesh = filter->GetOutput();
  return {took.count(), static_cast<std::uint64_t>(mesh->GetNumberOfPolys()),
          static_cast<std::uint64_t>(mesh->GetNumberOfPoints())};
}

std::string VtkPeer::version() {
  return std::string(vtkVersion::GetVTKVersion()) + ", SMP backend " + vtkSMPTools::GetBackend();
}

}  // namespace isobrick::bench

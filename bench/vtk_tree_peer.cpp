#include "bench/vtk_tree_peer.h"

#include <malloc.h>
#include <vtkContourFilter.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkSimpleScalarTree.h>
#include <vtkSmartPointer.h>
#include <vtkSpanSpace.h>
#include <vtkUniformGrid.h>

#include <chrono>

#include "bench/vtk_volume.h"

namespace isobrick::bench {
namespace {

using Clock = std::chrono::steady_clock;

std::uint64_t heap_bytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace

struct VtkTreePeer::Impl {
  vtkNew<vtkUniformGrid> grid;
  vtkNew<vtkContourFilter> filter;
  vtkSmartPointer<vtkScalarTree> tree;
};

VtkTreePeer::VtkTreePeer(std::int64_t x, std::int64_t y, std::int64_t z, int type, void* samples,
                         Tree tree)
    : impl_(std::make_unique<Impl>()) {
  show_samples(impl_->grid, x, y, z, type, samples);
  if (tree == Tree::simple) impl_->tree = vtkSmartPointer<vtkSimpleScalarTree>::New();
  if (tree == Tree::span_space) impl_->tree = vtkSmartPointer<vtkSpanSpace>::New();
  vtkContourFilter* filter = impl_->filter;
  filter->SetInputData(impl_->grid);
  filter->ComputeNormalsOff();
  filter->ComputeScalarsOff();
  filter->ComputeGradientsOff();
  filter->SetUseScalarTree(impl_->tree ? 1 : 0);
  if (impl_->tree) filter->SetScalarTree(impl_->tree);
}

VtkTreePeer::~VtkTreePeer() = default;

VtkTreePeer::Built VtkTreePeer::build() {
  if (!impl_->tree) return {};
  const std::uint64_t before = heap_bytes();
  const auto start = Clock::now();
  impl_->tree->SetDataSet(impl_->grid);
  impl_->tree->SetScalars(impl_->grid->GetPointData()->GetScalars());
  impl_->tree->BuildTree();
  const double took = seconds_since(start);
  return {took, heap_bytes() - before};
}

VtkTreePeer::Result VtkTreePeer::run(double isovalue) {
  impl_->filter->SetValue(0, isovalue);
  const auto start = Clock::now();
  impl_->filter->Update();
  const double took = seconds_since(start);
  return {took, static_cast<std::uint64_t>(impl_->filter->GetOutput()->GetNumberOfPolys())};
}

}  // namespace isobrick::bench

#pragma once

#include <vtkDataArray.h>
#include <vtkImageData.h>
#include <vtkPointData.h>
#include <vtkSmartPointer.h>

#include <cstdint>

namespace isobrick::bench {

/// Lets `image` (or a grid that is one) see samples in memory, without a copy.
/// `type` is the number of a ScalarType.
inline void show_samples(vtkImageData* image, std::int64_t x, std::int64_t y, std::int64_t z,
                         int type, void* samples) {
  constexpr int types[] = {VTK_UNSIGNED_CHAR, VTK_SIGNED_CHAR, VTK_UNSIGNED_SHORT, VTK_SHORT,
                           VTK_UNSIGNED_INT,  VTK_INT,         VTK_FLOAT,          VTK_DOUBLE};
  auto array = vtkSmartPointer<vtkDataArray>::Take(vtkDataArray::CreateDataArray(types[type]));
  array->SetVoidArray(samples, x * y * z, 1);
  array->SetName("samples");
  image->SetDimensions(static_cast<int>(x), static_cast<int>(y), static_cast<int>(z));
  image->GetPointData()->SetScalars(array);
}

}  // namespace isobrick::bench

// What a user of VTK does: read a raw file, run flying edges, write binary PLY.
// The peer of `isobrick extract` in bench/end_to_end.
//
//   vtk_raw_to_ply IN.raw X Y Z u8|i16|u16|f32 ISOVALUE OUT.ply THREADS
// Built as in bench/README.md.

#include <vtkFlyingEdges3D.h>
#include <vtkImageReader2.h>
#include <vtkNew.h>
#include <vtkPLYWriter.h>
#include <vtkPolyData.h>
#include <vtkSMPTools.h>

#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

int main(int argc, char** argv) {
  const std::map<std::string, int> types{{"u8", VTK_UNSIGNED_CHAR},
                                         {"u16", VTK_UNSIGNED_SHORT},
                                         {"i16", VTK_SHORT},
                                         {"f32", VTK_FLOAT}};
  if (argc != 9 || !types.count(argv[5])) {
    std::fprintf(stderr,
                 "usage: vtk_raw_to_ply IN.raw X Y Z u8|i16|u16|f32 ISOVALUE OUT.ply THREADS\n");
    return 2;
  }
  vtkSMPTools::SetBackend("TBB");
  vtkSMPTools::Initialize(std::atoi(argv[8]));
  vtkNew<vtkImageReader2> reader;
  reader->SetFileName(argv[1]);
  reader->SetFileDimensionality(3);
  reader->SetDataExtent(0, std::atoi(argv[2]) - 1, 0, std::atoi(argv[3]) - 1, 0,
                        std::atoi(argv[4]) - 1);
  reader->SetDataScalarType(types.at(argv[5]));
  reader->SetDataByteOrderToLittleEndian();
  vtkNew<vtkFlyingEdges3D> contour;
  contour->SetInputConnection(reader->GetOutputPort());
  contour->SetValue(0, std::atof(argv[6]));
  contour->ComputeNormalsOff();
  contour->ComputeScalarsOff();
  vtkNew<vtkPLYWriter> writer;
  writer->SetInputConnection(contour->GetOutputPort());
  writer->SetFileName(argv[7]);
  writer->SetFileTypeToBinary();
  writer->Write();
  std::printf("%lld triangles\n", static_cast<long long>(contour->GetOutput()->GetNumberOfPolys()));
  return 0;
}

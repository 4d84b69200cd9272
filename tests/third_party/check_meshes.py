"""Opens meshes with VTK's readers and compares them with the PLY of the same name.

  python3 check_meshes.py FOLDER

Exit status: 0 equal, 1 different, 77 VTK is not installed.
"""

import pathlib
import sys

try:
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy
    import numpy
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

failures = []


def check(condition, what):
    if not condition:
        failures.append(what)
        print(f"wrong: {what}")


class Mesh:
    """A mesh's arrays; corners in the order of the triangles."""

    def __init__(self, data):
        points = data.GetPoints()
        self.bounds = data.GetBounds()
        self.points = (
            vtk_to_numpy(points.GetData())
            if points and points.GetNumberOfPoints()
            else numpy.zeros((0, 3), numpy.float32)
        )
        polys = data.GetPolys()
        self.triangles = vtk_to_numpy(polys.GetConnectivityArray()).reshape(-1, 3)
        check(data.GetNumberOfCells() == len(self.triangles), "cells that are no triangles")
        normals = data.GetPointData().GetNormals()
        self.normals = None if normals is None else vtk_to_numpy(normals)

    def soup(self):
        return self.points[self.triangles] if len(self.triangles) else self.points[:0]

    def normal_soup(self):
        return self.normals[self.triangles]


def read(path, reader):
    errors = []
    reader.AddObserver("ErrorEvent", lambda *_: errors.append(1))
    reader.AddObserver("WarningEvent", lambda *_: errors.append(1))
    reader.SetFileName(str(path))
    reader.Update()
    check(not errors, f"{path.name}: VTK complains")
    return reader.GetOutput()


def read_glb(path):
    """A glTF reader gives blocks within blocks."""
    append = vtk.vtkAppendPolyData()
    blocks = read(path, vtk.vtkGLTFReader())
    iterator = blocks.NewIterator()
    iterator.InitTraversal()
    while not iterator.IsDoneWithTraversal():
        append.AddInputData(iterator.GetCurrentDataObject())
        iterator.GoToNextItem()
    append.Update()
    return append.GetOutput()


def same(a, b):
    return a.shape == b.shape and (a == b).all()


def unit_of(data):
    strings = data.GetFieldData().GetAbstractArray("unit")
    return strings.GetValue(0) if strings else None


def check_global_ids(name, pvtp, whole):
    ids = pvtp.GetPointData().GetGlobalIds()
    if not len(whole.points):
        return
    check(ids is not None, f"{name}.pvtp: no global ids")
    ids = vtk_to_numpy(ids)
    check(same(Mesh(pvtp).points, whole.points[ids]), f"{name}.pvtp: points of global ids")
    check(len(numpy.unique(ids)) == len(whole.points), f"{name}.pvtp: number of global ids")


def compare(base):
    name = base.name
    vtp = read(base.with_name(name + ".vtp"), vtk.vtkXMLPolyDataReader())
    unit = None if name in ("gyroid", "flat") else "micrometer"
    check(unit_of(vtp) == unit, f"{name}.vtp: the unit is {unit_of(vtp)}")
    reference = Mesh(read(base.with_name(name + ".ply"), vtk.vtkPLYReader()))
    whole = {
        "obj": Mesh(read(base.with_name(name + ".obj"), vtk.vtkOBJReader())),
        "vtp": Mesh(vtp),
    }
    glb = base.with_name(name + ".glb")
    if len(reference.triangles):
        whole["glb"] = Mesh(read_glb(glb))
    for kind, mesh in whole.items():
        check(same(mesh.points, reference.points), f"{name}.{kind}: points")
        check(same(mesh.triangles, reference.triangles), f"{name}.{kind}: triangles")
        check(mesh.bounds == reference.bounds, f"{name}.{kind}: bounds")
        if reference.normals is not None and len(reference.points):
            # VTK makes normals of glTF unit length once more.
            near = numpy.abs(mesh.normals - reference.normals).max() < 2e-7
            equal = near if kind == "glb" else same(mesh.normals, reference.normals)
            check(equal, f"{name}.{kind}: normals")
    pvtp = read(base.with_name(name + ".pvtp"), vtk.vtkXMLPPolyDataReader())
    parts = Mesh(pvtp)
    check_global_ids(name, pvtp, reference)
    check(same(parts.soup(), reference.soup()), f"{name}.pvtp: triangles")
    check(parts.bounds == reference.bounds, f"{name}.pvtp: bounds")
    if reference.normals is not None and len(reference.points):
        check(same(parts.normal_soup(), reference.normal_soup()), f"{name}.pvtp: normals")
    print(f"{name}: {len(reference.points)} points, {len(reference.triangles)} triangles")


def main() -> int:
    names = sorted(pathlib.Path(sys.argv[1]).glob("*.ply"))
    check(len(names) >= 5, "meshes are missing")
    for path in names:
        compare(path.with_suffix(""))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())

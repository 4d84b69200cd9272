"""Isobrick, scikit-image and VTK on the same arrays in one run; bench/README.md lists all benches.

    PYTHONPATH=build/release/python python3 bench/python_bench.py [--edge 256] [--repeats 5] [--json]
"""

import argparse
import json
import statistics
import time

import numpy as np
from skimage import measure

import isobrick

try:
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D
except ImportError:
    vtkFlyingEdges3D = None


def flying_edges(volume, level):
    """VTK's surface of an array in C order, without normals, as arrays of VTK."""
    image = vtkImageData()
    image.SetDimensions(volume.shape[::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(volume.ravel()))
    filter = vtkFlyingEdges3D()
    filter.SetInputData(image)
    filter.SetValue(0, level)
    filter.ComputeNormalsOff()
    filter.ComputeScalarsOff()
    filter.Update()
    return filter.GetOutput()


def triangles_of(mesh):
    if isinstance(mesh, tuple):
        return len(mesh[1])
    return len(mesh) if isinstance(mesh, isobrick.Mesh) else mesh.GetNumberOfPolys()


def compare(name, volume, level, repeats):
    extractor = isobrick.Extractor(volume)
    extractor.extract(level)
    rows = {
        "skimage.measure.marching_cubes": lambda: measure.marching_cubes(volume, level),
        "isobrick.marching_cubes": lambda: isobrick.marching_cubes(volume, level),
        "isobrick.extract, normals": lambda: isobrick.extract(volume, level, normals=True),
        "isobrick.extract": lambda: isobrick.extract(volume, level),
        "Extractor.extract, later isovalue": lambda: extractor.extract(level),
    }
    if vtkFlyingEdges3D and volume.flags.c_contiguous:
        rows["vtkFlyingEdges3D"] = lambda: flying_edges(volume, level)
    times = {row: [] for row in rows}
    triangles = {}
    for _ in range(repeats):  # in turn, so that a busy moment meets all
        for row, work in rows.items():
            begin = time.perf_counter()
            mesh = work()
            times[row].append(time.perf_counter() - begin)
            triangles[row] = triangles_of(mesh)
            del mesh  # or the next row would free it
    return [
        {"volume": name, "what": row, "median": statistics.median(times[row]),
         "minimum": min(times[row]), "triangles": triangles[row]}
        for row in rows
    ]


def arrays_of(kind, edge):
    """(name, array, isovalue) of each type, and of each layout."""
    for dtype in ("u1", "i2", "f4", "f8"):
        volume = isobrick.synth(kind, shape=(edge,) * 3, dtype=dtype, noise=0)
        level = {"u1": 127.5, "i2": -0.5}.get(dtype, 0.0)
        yield f"{volume.dtype}", volume, level
        if dtype == "f4":
            yield "float32, Fortran order", np.asfortranarray(volume), level
            wide = np.zeros((edge, edge, 2 * edge), volume.dtype)
            wide[:, :, ::2] = volume
            yield "float32, every second sample", wide[:, :, ::2], level


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--edge", type=int, default=256, help="samples along each axis")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--kind", default="sphere", help="sphere, gyroid or mixing")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    results = []
    for name, volume, level in arrays_of(arguments.kind, arguments.edge):
        results += compare(name, volume, level, arguments.repeats)
    if arguments.json:
        print(json.dumps(results, indent=1))
        return
    print(f"{arguments.kind} of {arguments.edge}³ samples")
    for row in results:
        print(f"{row['volume']:30}{row['what']:36}{1e3 * row['median']:9.1f} ms, least "
              f"{1e3 * row['minimum']:9.1f} ms {row['triangles']:12,} triangles")


if __name__ == "__main__":
    main()

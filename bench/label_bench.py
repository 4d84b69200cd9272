#!/usr/bin/env python3
"""Meshes of all labels of an array, beside VTK's vtkDiscreteFlyingEdges3D.

  PYTHONPATH=build/release/python python3 bench/label_bench.py [--edge 256] [--cells 4,8,16]
    [--threads 2] [--repeat 3]

Both have the same array of computed cells in memory, and write their meshes to memory. VTK's meshes
are one for all labels, of which every wall is there twice, as in Isobrick's. Times are the least of
the runs, which take turns.
"""

import argparse
import time

import numpy as np

import isobrick


def of_isobrick(cells, threads):
    meshes = isobrick.extract_labels(cells, threads=threads)
    return sum(len(mesh.faces) for mesh in meshes.values())


def of_vtk(cells, threads):
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    vtk.vtkSMPTools.Initialize(threads)
    image = vtk.vtkImageData()
    image.SetDimensions(*cells.shape[::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(cells.ravel(), deep=False))
    contour = vtk.vtkDiscreteFlyingEdges3D()
    contour.SetInputData(image)
    contour.ComputeNormalsOff()
    contour.ComputeGradientsOff()
    contour.ComputeScalarsOff()
    for i, label in enumerate(np.unique(cells[cells > 0])):
        contour.SetValue(i, int(label))
    start = time.perf_counter()
    contour.Update()
    return time.perf_counter() - start, contour.GetOutput().GetNumberOfPolys()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--edge", type=int, default=256)
    parser.add_argument("--cells", default="4,8", help="along each edge, several to compare")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeat", type=int, default=3)
    arguments = parser.parse_args()
    print(f"edge {arguments.edge}, {arguments.threads} threads")
    for count in map(int, arguments.cells.split(",")):
        cells = isobrick.synth(
            "cells", shape=(arguments.edge,) * 3, dtype="uint16", frequency=count
        )
        ours, theirs = [], []
        for _ in range(arguments.repeat):
            start = time.perf_counter()
            triangles = of_isobrick(cells, arguments.threads)
            ours.append(time.perf_counter() - start)
            seconds, vtk_triangles = of_vtk(cells, arguments.threads)
            theirs.append(seconds)
        print(
            f"{len(np.unique(cells)) - 1:6} labels: {min(ours):.3f} s, {triangles:,} triangles; "
            f"VTK {min(theirs):.3f} s, {vtk_triangles:,} triangles; "
            f"{min(theirs) / min(ours):.1f} times",
            flush=True,
        )


if __name__ == "__main__":
    main()

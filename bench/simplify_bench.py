"""Simplification beside VTK's at the same goals; bench/README.md lists all benches.

    PYTHONPATH=build/release/python python3 bench/simplify_bench.py scan.zarr ISOVALUE [--ratio 0.1] [--json]

Both get the mesh in memory. Distances are from vertices of the original to the simplified mesh, by VTK's cell
locator, in world units. A side of more than two triangles is not manifold.
"""

import argparse
import json
import time

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

import isobrick

SAMPLED_VERTICES = 100_000


def distances(original, simplified):
    locator = vtk.vtkStaticCellLocator()
    locator.SetDataSet(simplified)
    locator.BuildLocator()
    points = vtk_to_numpy(original.GetPoints().GetData())
    count = min(len(points), SAMPLED_VERTICES)
    chosen = np.random.default_rng(1).choice(len(points), count, replace=False)
    nearest, cell, part, square = [0.0] * 3, vtk.reference(0), vtk.reference(0), vtk.reference(0.0)
    found = []
    for point in points[chosen]:
        locator.FindClosestPoint(point, nearest, cell, part, square)
        found.append(float(square) ** 0.5)
    return float(np.mean(found)), float(np.max(found))


def non_manifold_sides(mesh):
    edges = vtk.vtkFeatureEdges()
    edges.SetInputData(mesh)
    edges.BoundaryEdgesOff()
    edges.FeatureEdgesOff()
    edges.NonManifoldEdgesOn()
    edges.Update()
    return edges.GetOutput().GetNumberOfCells()


def by_isobrick(mesh, ratio):
    return mesh.filtered(simplify=ratio).to_vtk()


def by_vtk(mesh, ratio):
    decimation = vtk.vtkQuadricDecimation()
    decimation.SetInputData(mesh.to_vtk())
    decimation.SetTargetReduction(1 - ratio)
    decimation.Update()
    return decimation.GetOutput()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("input")
    parser.add_argument("isovalue")
    parser.add_argument("--ratio", type=float, default=0.1)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    mesh = isobrick.open(arguments.input).extract(arguments.isovalue, normals=False)
    original = mesh.to_vtk()
    results = []
    for name, simplify in (("Isobrick", by_isobrick), ("vtkQuadricDecimation", by_vtk)):
        begin = time.perf_counter()
        simplified = simplify(mesh, arguments.ratio)
        seconds = time.perf_counter() - begin
        mean, largest = distances(original, simplified)
        results.append({
            "name": name, "seconds": seconds, "goal": round(arguments.ratio * len(mesh)),
            "triangles": simplified.GetNumberOfCells(), "mean": mean, "largest": largest,
            "non_manifold_sides": non_manifold_sides(simplified),
        })
    if arguments.json:
        print(json.dumps(results))
        return
    for r in results:
        print(f"{r['name']:22} {r['triangles']:9,} of {r['goal']:,} in {r['seconds']:.2f} s, "
              f"mean {r['mean']:.4f}, largest {r['largest']:.3f}, "
              f"{r['non_manifold_sides']} sides of more than two triangles")


if __name__ == "__main__":
    main()

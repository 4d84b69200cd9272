#!/usr/bin/env python3
"""isobrick beside OpenVDB (python3-openvdb) on a sparse grid, in turn, in processes of their own.

  vdb_bench.py PROGRAM [RADIUS [RUNS]]

A level set of a sphere of RADIUS voxels (400):
  convert  `isobrick convert`          | read the grid, copy its box to a dense array
  extract  `isobrick extract`: the whole process, from the store to a PLY file
                                       | volumeToMesh at adaptivity 0 alone: grid read before,
                                         nothing written

Wall and processor seconds, medians of RUNS (9), how many times as fast as OpenVDB by pairs, and
peak memory. Both use all cores. What was written before is removed between the runs.
"""

import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

PEER_DENSE = """
import sys, numpy, pyopenvdb as vdb
grid = vdb.read(sys.argv[1], "ls_sphere")
low, high = grid.evalActiveVoxelBoundingBox()
grid.copyToArray(numpy.empty([b - a + 1 for a, b in zip(low, high)], numpy.float32), ijk=low)
"""
PEER_MESH = """
import sys, time, numpy, pyopenvdb as vdb
grid = vdb.read(sys.argv[1], "ls_sphere")
wall, cpu = time.perf_counter(), time.process_time()
points, triangles, quads = grid.convertToPolygons(isovalue=0, adaptivity=0)
print(time.perf_counter() - wall, time.process_time() - cpu, len(points), len(triangles) + 2 * len(quads))
"""
PYTHON = "/usr/bin/python3"


def measure(words):
    """Wall seconds, processor seconds, peak MiB and output of a process."""
    start = time.perf_counter()
    process = subprocess.Popen(list(map(str, words)), stdout=subprocess.PIPE)
    output = process.stdout.read().decode()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"{words} failed")
    return time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, output


def row(name, runs):
    wall, cpu, memory = (statistics.median(run[i] for run in runs) for i in range(3))
    print(f"{name:28} {wall:8.2f} s {cpu:8.2f} s cpu {memory:8.0f} MiB", flush=True)


def pairs(peer, ours):
    """How many times as fast as the peer that ran next to it."""
    wall, cpu = (statistics.median(b[i] / a[i] for a, b in zip(ours, peer)) for i in range(2))
    return f"{wall:.2f} times as fast by wall, {cpu:.2f} by processor seconds"


def main():
    program, radius = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 400
    count = int(sys.argv[3]) if len(sys.argv) > 3 else 9
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        path, store = folder / "s.vdb", folder / "s.zarr"
        subprocess.run([PYTHON, "-c", f"""
import pyopenvdb as vdb
grid = vdb.createLevelSetSphere(radius={radius}, voxelSize=1)
grid.name = "ls_sphere"
vdb.write({str(path)!r}, [grid])"""], check=True)
        print(f"load {os.getloadavg()[0]:.1f}, file {path.stat().st_size >> 20} MiB")
        ours, peer, meshes, peer_meshes = [], [], [], []
        for _ in range(count):
            shutil.rmtree(store, ignore_errors=True)
            ours.append(measure([program, "convert", path, store]))
            peer.append(measure([PYTHON, "-c", PEER_DENSE, path]))
        for _ in range(count):
            (folder / "m.ply").unlink(missing_ok=True)
            meshes.append(measure([program, "extract", store, "--isovalue", 0, "-o", folder / "m.ply", "--normals", "none"]))
            whole = measure([PYTHON, "-c", PEER_MESH, path])
            inside = [float(word) for word in whole[3].split()]
            peer_meshes.append((inside[0], inside[1], whole[2], inside[3]))
        row("convert", ours)
        row("OpenVDB read + copyToDense", peer)
        print(f"  {pairs(peer, ours)}")
        row("extract", meshes)
        row("OpenVDB volumeToMesh", peer_meshes)
        print(f"  {pairs(peer_meshes, meshes)}")
        print(meshes[-1][3].strip())
        print(f"OpenVDB: {peer_meshes[-1][3]:.0f} triangles")


if __name__ == "__main__":
    main()

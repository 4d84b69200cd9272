"""Isobrick and scikit-image on the same arrays in one run; bench/README.md says how to run it.

    PYTHONPATH=BUILD/python python3 bench/python_bench.py [--edge 256] [--repeats 5] [--json]
"""

import argparse
import json
import statistics
import time

import numpy as np
from skimage import measure

import isobrick


def seconds_of(work, repeats):
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - begin)
    return statistics.median(times), result


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
    result = []
    for row, work in rows.items():
        seconds, mesh = seconds_of(work, 3 if row.startswith("skimage") else repeats)
        triangles = len(mesh[1]) if isinstance(mesh, tuple) else len(mesh)
        times = result[0]["seconds"] / seconds if result else 1
        result.append({"volume": name, "what": row, "seconds": seconds, "triangles": triangles,
                       "times_as_fast": times})
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--edge", type=int, default=256, help="samples along each axis")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    shape = (arguments.edge,) * 3
    results = []
    for kind in ("sphere", "gyroid"):
        volume = isobrick.synth(kind, shape=shape, dtype="f4", noise=0)
        for name, array in (("C order", volume), ("Fortran order", np.asfortranarray(volume)),
                            ("uint8", isobrick.synth(kind, shape=shape, dtype="u1", noise=0))):
            level = 127.5 if name == "uint8" else 0.0
            results += compare(f"{kind} {arguments.edge}³, {name}", array, level, arguments.repeats)
    if arguments.json:
        print(json.dumps(results, indent=1))
        return
    for row in results:
        print(f"{row['volume']:28} {row['what']:36} {1e3 * row['seconds']:9.1f} ms "
              f"{row['triangles']:10,} triangles {row['times_as_fast']:8.1f}×")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Times `isobrick convert` beside `zstd` on the same bytes.

Both run in turn, so that whatever else the machine does meets both alike; the
medians of wall and processor time are printed, and their ratio. A conversion
also computes ranges and the pyramid; zstd only compresses.

    bench/convert_bench.py build/release/bin/isobrick engine_256x256x128_uint8.raw …
"""

import argparse
import os
import resource
import shutil
import statistics
import subprocess
import tempfile
import time


def timed(command):
    """Wall and processor seconds of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.monotonic()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wall = time.monotonic() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def tree_bytes(path):
    return sum(os.path.getsize(os.path.join(folder, name))
               for folder, _, names in os.walk(path) for name in names)


def measure(arguments, raw, folder):
    store = os.path.join(folder, "out.zarr")
    packed = os.path.join(folder, "out.zst")
    runs = {"isobrick": [], "zstd": []}
    for _ in range(arguments.repeat):
        shutil.rmtree(store, ignore_errors=True)
        runs["isobrick"].append(timed([arguments.isobrick, "convert", raw, store,
                                       "--threads", str(arguments.threads)] + arguments.option))
        runs["zstd"].append(timed(["zstd", "-q", "-f", f"-T{arguments.threads}",
                                   f"-{arguments.level}", raw, "-o", packed]))
    size = os.path.getsize(raw)
    medians = {}
    for name, out in (("isobrick", tree_bytes(store)), ("zstd", os.path.getsize(packed))):
        wall = statistics.median(run[0] for run in runs[name])
        cpu = statistics.median(run[1] for run in runs[name])
        medians[name] = wall, cpu
        print(f"  {name:9}{wall:9.3f} s wall {cpu:9.3f} s cpu {size / wall / 1e6:9.1f} MB/s "
              f"{out:13} bytes")
    ratio = [medians["isobrick"][i] / medians["zstd"][i] for i in (0, 1)]
    print(f"  ratio    {ratio[0]:9.2f}        {ratio[1]:9.2f}")
    shutil.rmtree(store)
    os.unlink(packed)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("isobrick", help="the program")
    parser.add_argument("raw", nargs="+", help="raw files with extent and type in their names")
    parser.add_argument("--folder", help="where to write (default: the temporary folder)")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--level", type=int, default=3, help="of zstd")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--option", action="append", default=[],
                        help="passed on to convert, such as --option=--brick=32")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
        for raw in arguments.raw:
            with open(raw, "rb") as file:  # into the page cache
                while file.read(1 << 24):
                    pass
            print(os.path.basename(raw))
            measure(arguments, raw, folder)


if __name__ == "__main__":
    main()

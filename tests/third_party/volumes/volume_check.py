"""What the checks of volume formats share: convert with isobrick, compare.

A check writes files with a library of others and compares every sample, and the
world positions of the corners, with what that library reads of them. Exit
status: 0 equal, 1 different, 77 the library is not installed.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

try:
    import numpy
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)


class Check:
    """One program, one folder, and what went wrong so far."""

    def __init__(self, program, originals, folder):
        self.program = program
        self.originals = pathlib.Path(originals)
        self.folder = pathlib.Path(folder)
        self.checked = 0
        self.failures = []

    def run(self, *words):
        return subprocess.run([self.program, *map(str, words)], capture_output=True, encoding="utf-8",
                              check=False)

    def read(self, path, *options):
        """Samples [z, y, x] and geometry of a volume, by way of a store."""
        store, raw = self.folder / "check.zarr", self.folder / "check.raw"
        for words in (["convert", path, store, "--force", "--levels", "1", *options],
                      ["export", store, raw, "--force"]):
            done = self.run(*words)
            if done.returncode != 0:
                raise RuntimeError(f"{' '.join(map(str, words))}: {done.stderr.strip()}")
        info = json.loads(self.run("info", store, "--json").stdout)
        x, y, z = info["extent"]
        samples = numpy.fromfile(raw, dtype=numpy.dtype(info["type"]).newbyteorder("<"))
        return samples.reshape(z, y, x), info

    def same(self, name, path, expected, affine=None, options=(), exact=True):
        """Compares with an array [z, y, x] and a matrix from index (x, y, z) to world."""
        self.checked += 1
        try:
            got, info = self.read(path, *options)
        except RuntimeError as error:
            self.failures.append(f"{name}: {error}")
            return
        if got.dtype != expected.dtype.newbyteorder("=") or got.shape != expected.shape:
            self.failures.append(f"{name}: {got.dtype} {got.shape} instead of {expected.dtype} "
                                 f"{expected.shape}")
        elif not (numpy.array_equal(got, expected, equal_nan=got.dtype.kind == "f") if exact else
                  numpy.allclose(got, expected, rtol=1e-6, atol=0, equal_nan=True)):
            self.failures.append(f"{name}: {numpy.count_nonzero(got != expected)} samples differ")
        if affine is not None:
            ours = affine_of(info)
            if not numpy.allclose(ours, affine, rtol=1e-5, atol=1e-4):
                self.failures.append(f"{name}: transform\n{ours}\ninstead of\n{affine}")

    def refused(self, name, path, *parts, options=()):
        """A clear line that has all `parts`, within seconds."""
        self.checked += 1
        done = self.run("convert", path, self.folder / "refused.zarr", "--force", *options)
        lines = done.stderr.strip().splitlines()
        if done.returncode not in (1, 2) or len(lines) != 1:
            self.failures.append(f"{name}: exit {done.returncode}, {done.stderr!r}")
        elif not all(part in lines[0] for part in parts):
            self.failures.append(f"{name}: {lines[0]!r} has not {parts}")


def affine_of(info):
    """The 4×4 matrix from index (x, y, z) to world."""
    matrix = numpy.eye(4)
    direction = numpy.array(info.get("direction", [1, 0, 0, 0, 1, 0, 0, 0, 1])).reshape(3, 3)
    matrix[:3, :3] = direction * numpy.array(info["spacing"])
    matrix[:3, 3] = info["origin"]
    return matrix


def pattern(shape, dtype):
    """Samples [z, y, x] whose values are their places."""
    count = numpy.arange(numpy.prod(shape), dtype=numpy.uint64) * 2654435761
    kind = numpy.dtype(dtype)
    if kind.kind == "f":
        return (count % 1000003 / 7 - 1000).astype(kind).reshape(shape)
    return (count >> 3).astype(kind.str.replace("i", "u")).view(kind).reshape(shape)


def main(check):
    """check.py PROGRAM ORIGINALS: runs check(Check) in a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        state = Check(sys.argv[1], sys.argv[2], folder)
        check(state)
    for failure in state.failures:
        print(failure)
    if state.checked == 0:
        print("skipped: there are no volumes to check")
        return 77
    print(f"{state.checked} checked, {len(state.failures)} failed")
    return 1 if state.failures else 0

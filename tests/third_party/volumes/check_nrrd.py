"""NRRD files that others wrote, beside numpy reading what gzip unpacks."""

import gzip
import sys

from volume_check import main, numpy

TYPES = {"unsigned char": "u1", "short": "<i2", "float": "<f4"}


def vector(text):
    return [float(number) for number in text.strip("()").split(",")]


def check(state):
    for path in sorted(state.originals.glob("*.nrrd")):
        header, _, packed = path.read_bytes().partition(b"\n\n")
        fields = dict(line.split(": ", 1) for line in header.decode().splitlines()
                      if ": " in line and not line.startswith("#"))
        sizes = [int(size) for size in fields["sizes"].split()]
        samples = numpy.frombuffer(gzip.decompress(packed), TYPES[fields["type"]])
        affine = numpy.eye(4)
        axes = fields["space directions"].replace(", ", ",").split()
        affine[:3, :3] = numpy.array([vector(axis) for axis in axes]).T
        affine[:3, 3] = vector(fields["space origin"])
        state.same(path.name, path, samples.reshape(sizes[::-1]), affine)


if __name__ == "__main__":
    sys.exit(main(check))

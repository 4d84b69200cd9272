"""TIFF stacks that tifffile writes, beside what it reads."""

import itertools
import sys

from volume_check import main, numpy, pattern

try:
    import tifffile
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

KINDS = ["u1", "i1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"]


def compressions():
    """Those that this tifffile can write."""
    found = [None]
    for name in ("zlib", "lzw", "packbits", "zstd"):
        try:
            tifffile.imwrite("/dev/null", numpy.zeros((8, 8), "u1"), compression=name)
            found.append(name)
        except Exception:  # pylint: disable=broad-except
            continue
    return found


def check_pages(state):
    path = state.folder / "stack.tif"
    for kind, big, order, layout, compression in itertools.product(
            KINDS, (False, True), "<>", ({}, {"rowsperstrip": 3}, {"tile": (16, 32)}),
            compressions()):
        samples = pattern((5, 37, 41), kind)
        tifffile.imwrite(path, samples, bigtiff=big, byteorder=order, compression=compression,
                         photometric="minisblack", metadata=None, **layout)
        name = f"{kind} {'big ' if big else ''}{order} {layout} {compression}"
        if (big, compression) == (True, None) or kind in ("u1", "u2", "f4"):
            state.same(name, path, tifffile.imread(path))


def check_folder(state):
    folder = state.folder / "slices"
    folder.mkdir()
    samples = pattern((12, 9, 8), "u2")
    for z, plane in enumerate(samples):
        tifffile.imwrite(folder / f"slice{z + 1}.tif", plane)
    (folder / "notes.txt").write_text("not a slice")
    state.same("folder", folder, samples)
    tifffile.imwrite(folder / "slice5.tif", samples[4][:, :-1])
    state.refused("folder of two sizes", folder, "slice5.tif", "7 x 9")


def check_channels(state):
    path = state.folder / "stack.tif"
    samples = pattern((4, 9, 8, 3), "u1")
    for planar in ("contig", "separate"):
        stored = samples if planar == "contig" else numpy.moveaxis(samples, 3, 1)
        for layout in ({}, {"tile": (16, 16)}, {"rowsperstrip": 2}):
            tifffile.imwrite(path, stored, photometric="rgb", planarconfig=planar, metadata=None,
                             **layout)
            state.refused(f"rgb {planar}", path, "3 channels", "--channel")
            for c in range(3):
                state.same(f"rgb {planar} {layout} {c}", path, samples[..., c],
                           options=("--channel", c))
    samples = pattern((2, 4, 3, 9, 8), "u2")  # t z c y x
    affine = numpy.diag([0.25, 0.5, 3, 1])
    for truncate, order in ((False, "<"), (True, ">")):
        tifffile.imwrite(path, samples.astype(samples.dtype.newbyteorder(order)), imagej=True,
                         byteorder=order, resolution=(4, 2), metadata={
                             "spacing": 3, "unit": "um", "axes": "TZCYX"},
                         **({"truncate": True} if truncate else {}))
        state.refused("hyperstack", path, "3 channels")
        for t, c in itertools.product(range(2), range(3)):
            state.same(f"hyperstack {truncate} {t} {c}", path, samples[t, :, c], affine,
                       options=("--channel", c, "--time", t))
    for axes, order in (("TZCYX", (0, 1, 2)), ("CTZYX", (2, 0, 1)), ("ZCTYX", (1, 2, 0))):
        ome = state.folder / "stack.ome.tif"
        tifffile.imwrite(ome, samples.transpose(order + (3, 4)), photometric="minisblack", metadata={
            "axes": axes, "PhysicalSizeX": 0.25, "PhysicalSizeY": 0.5, "PhysicalSizeZ": 3})
        for t, c in itertools.product(range(2), range(3)):
            state.same(f"OME {axes} {t} {c}", ome, samples[t, :, c], affine,
                       options=("--channel", c, "--time", t))


def check(state):
    check_pages(state)
    check_folder(state)
    check_channels(state)


if __name__ == "__main__":
    sys.exit(main(check))

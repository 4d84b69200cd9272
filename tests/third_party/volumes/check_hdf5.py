"""HDF5 datasets that h5py writes, beside what it reads."""

import itertools
import sys

from volume_check import main, numpy, pattern

try:
    import h5py
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)


def check(state):
    path = state.folder / "v.h5"
    for kind, order, layout in itertools.product(
            ("u1", "i1", "i2", "u2", "i4", "u4", "f4", "f8"), "<>",
            ({}, {"chunks": (5, 7, 6)}, {"chunks": (40, 4, 50), "compression": "gzip"},
             {"chunks": (3, 30, 40), "compression": "gzip", "shuffle": True, "fletcher32": True})):
        samples = pattern((45, 33, 51), kind)
        with h5py.File(path, "w", userblock_size=1024 if layout else 0) as file:
            file.create_dataset("deep/er/v", data=samples, dtype=numpy.dtype(kind).newbyteorder(order),
                                **layout)
            file["plane"] = samples[0]
        name = f"{kind} {order} {layout}"
        state.same(name, path, samples)
        state.same(name, f"{path}:/deep/er/v", samples, options=("--memory", "64M"))
    half = (pattern((5, 6, 7), "u1") / 8).astype("f2")
    series = pattern((2, 5, 6, 7, 3), "i2")  # t z y x c
    with h5py.File(path, "w") as file:
        file["half"] = half
        file["series"] = series
        file["labelled"] = series.transpose(4, 1, 2, 3, 0)
        for i, label in enumerate("CZYXT"):
            file["labelled"].dims[i].label = label
        file["spaced"] = half
        file["spaced"].attrs["element_size_um"] = [3, 0.5, 0.25]
        file["long"] = half.astype("i8")
        file["huge"] = half.astype("i8") + (2**60 + 1)
        file["outside"] = h5py.ExternalLink("/etc/passwd", "x")
        layout = h5py.VirtualLayout((5, 6, 7), "f2")
        layout[:] = h5py.VirtualSource("other.h5", "half", (5, 6, 7))
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("lzf", data=half, compression="lzf")  # h5py's own
        file.create_dataset("lzf_all", data=half, compression="lzf", shuffle=True, fletcher32=True)
        file.create_dataset("elsewhere", (5, 6, 7), "u1", external=[("/etc/passwd", 0, 210)])
    state.same("half", f"{path}:/half", half.astype("f4"))
    state.same("spaced", f"{path}:/spaced", half.astype("f4"), numpy.diag([0.25, 0.5, 3, 1]))
    for name, (t, c) in itertools.product(("series", "labelled"),
                                          itertools.product(range(2), range(3))):
        state.same(f"{name} {t} {c}", f"{path}:/{name}", series[t, ..., c],
                   options=("--time", t, "--channel", c))
    state.refused("series", f"{path}:/series", "5 dimensions", "--channel")
    state.refused("labelled", f"{path}:/labelled", "3 channels", "--channel 0")
    state.refused("several", path, "datasets", ":/NAME", "/half")
    state.refused("nothing", f"{path}:/nothing", "nothing")
    state.same("long", f"{path}:/long", half.astype("i8"))
    state.same("huge", f"{path}:/huge", half.astype("i8") + (2**60 + 1))
    state.refused("external link", f"{path}:/outside", "outside")
    state.refused("virtual", f"{path}:/virtual", "virtual")
    for name in ("lzf", "lzf_all"):
        state.same(name, f"{path}:/{name}", half.astype("f4"))
    state.refused("external storage", f"{path}:/elsewhere", "other files")
    with h5py.File(path, "w") as file:
        file.create_dataset("huge", (2**40, 2**40, 2**40), "u1", chunks=(16, 16, 16))
        file.create_dataset("chunky", (2**16, 2**16, 2**16), "u1", chunks=(2**10, 2**10, 2**11))
    state.refused("huge", f"{path}:/huge", "too large")
    state.refused("large chunks", f"{path}:/chunky", "budget", options=("--memory", "256M"))


if __name__ == "__main__":
    sys.exit(main(check))

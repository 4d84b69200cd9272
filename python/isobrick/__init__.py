"""Isosurfaces of volumes larger than memory.

    import isobrick

    mesh = isobrick.extract(array, 300, spacing=(0.5, 0.5, 1.0))   # a NumPy array [z, y, x]
    mesh.vertices, mesh.faces                                      # NumPy arrays without copies
    mesh.save("bone.ply")

    volume = isobrick.open("scan.nrrd")                            # a file of any format
    volume.extract("otsu", level=1, normals=True)
    isobrick.render(volume, "otsu")                                # a picture in a notebook

Axis order: arrays and all that indexes them (shape, roi, brick) are [z, y, x]. World space
(spacing, origin, direction, vertices, normals) is x, y, z, as in VTK, SimpleITK and nibabel. Only
`marching_cubes`, which stands in for scikit-image's, has everything in the order of the array.

Long operations take `progress=`, leave the GIL to other threads, and end within a second of Ctrl-C.
"""

from ._device import DeviceMesh, DeviceRows, DeviceVolume
from ._errors import DamageError, Error, FileError, UsageError
from ._extract import Extractor, extract
from ._isobrick import __version__
from ._labels import extract_labels
from ._marching_cubes import marching_cubes
from ._mesh import Measure, Mesh
from ._open import open
from ._operations import convert, export, index, info, recode, synth, verify
from ._picture import Picture, render
from ._pieces import merge, merge_labels
from ._volume import Histogram, Level, Volume

__all__ = [
    "DamageError",
    "DeviceMesh",
    "DeviceRows",
    "DeviceVolume",
    "Error",
    "Extractor",
    "FileError",
    "Histogram",
    "Level",
    "Measure",
    "Mesh",
    "Picture",
    "UsageError",
    "Volume",
    "__version__",
    "convert",
    "export",
    "extract",
    "extract_labels",
    "index",
    "info",
    "marching_cubes",
    "merge",
    "merge_labels",
    "open",
    "recode",
    "render",
    "synth",
    "verify",
]

# Messages and help() name things as programs do.
for _thing in (globals()[_name] for _name in __all__):
    if hasattr(_thing, "__module__"):
        _thing.__module__ = __name__
del _thing

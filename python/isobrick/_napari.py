"""The reader of napari, which napari.yaml names: volumes as multiscale images."""

import os

import numpy as np

from ._errors import Error
from ._indexing import read_indexed
from ._operations import info
from ._open import open as open_volume


class LevelArray:
    """The samples of a level as napari and dask take arrays: [z, y, x], read when indexed."""

    def __init__(self, volume, level):
        self._volume = volume
        self._level = level
        self.shape = tuple(volume.levels[level].shape)
        self.dtype = volume.dtype
        self.ndim = 3

    @property
    def size(self):
        return int(np.prod(self.shape))

    def __len__(self):
        return self.shape[0]

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self[:], dtype)

    def __getitem__(self, index):
        """Samples by slices, steps and integers, as a new array. Reads the box that covers them."""
        return read_indexed(
            index, self.shape, self.dtype, lambda box: self._volume.read(self._level, box)
        )


def reader_of(path):
    """A function that gives the layers of a store; None for anything else, which others open.

    An image of another program would have to be converted first.
    """
    if isinstance(path, (list, tuple)):  # files to be stacked
        return None
    try:
        if not info(path)["is_store"]:
            return None
        volume = open_volume(path)
    except (Error, OSError):
        return None
    return lambda path: [image_layer(path, volume)]


def image_layer(path, volume):
    """(data, arguments, type) of an image layer, with an array for each level."""
    arguments = {
        "name": os.path.basename(os.path.normpath(path)).removesuffix(".zip").removesuffix(".zarr"),
        "multiscale": len(volume.levels) > 1,
        "scale": volume.spacing[::-1],
        "translate": volume.origin[::-1],
        "metadata": {"path": volume.path, "unit": volume.unit},
    }
    if not np.array_equal(volume.direction, np.eye(3)):
        arguments["rotate"] = volume.direction[::-1, ::-1]
    if volume.range is not None and volume.range[0] < volume.range[1]:
        arguments["contrast_limits"] = tuple(map(float, volume.range))
    if volume.unit and _takes_units():
        arguments["units"] = (volume.unit,) * 3
    levels = [LevelArray(volume, level) for level in range(len(volume.levels))]
    return levels if len(levels) > 1 else levels[0], arguments, "image"


def _takes_units():
    """Whether layers have units: those of older versions of napari have none."""
    try:
        from napari.layers import Image
    except ImportError:
        return False
    return hasattr(Image, "units")

"""What can be extracted from: arrays in memory, and arrays that are read by blocks."""

import numpy as np

from . import _isobrick
from ._arguments import number, transform
from ._device import is_on_device
from ._errors import UsageError
from ._blocks import BlockReader

_TYPES = "uint8, int8, uint16, int16, uint32, int32, float32, float64 or bool"
_SUPPORTED = {np.dtype(name) for name in
              ("u1", "i1", "u2", "i2", "u4", "i4", "f4", "f8", "?")}
# Labels, of which no surfaces are made.
_WIDE = {np.dtype("u8"), np.dtype("i8")}


# What is known of an array besides its samples.
ARRAY_NAMES = ("spacing", "origin", "direction", "unit", "mask", "nodata")


def check_dtype(dtype, what="array", wide=False):
    """The dtype in native byte order. Raises TypeError for one that is not supported.

    `wide`: 64-bit integers are.
    """
    dtype = np.dtype(dtype)
    native = dtype.newbyteorder("=")
    if native not in _SUPPORTED and not (wide and native in _WIDE):
        advice = ""
        if dtype.kind in "iu":
            advice = "; if the values fit, use array.astype('int32')"
        elif dtype.kind == "f":
            advice = "; use array.astype('float32')"
        raise TypeError(f"{what} has dtype {dtype}; samples must be {_TYPES}{advice}")
    return native


def _check_shape(shape):
    shape = tuple(int(size) for size in shape)
    if len(shape) != 3:
        raise UsageError(f"array must have three axes [z, y, x], not {len(shape)} (shape {shape})")
    if min(shape) < 1:
        raise UsageError(f"array of shape {shape} has no samples")
    return shape


def _checked_mask(mask, shape):
    if mask is None:
        return None
    if isinstance(mask, np.ma.MaskedArray):
        raise TypeError("mask is a numpy.ma.MaskedArray; give an array of bool")
    mask = np.asarray(mask)
    if mask.dtype not in (np.dtype("?"), np.dtype("u1")):
        raise TypeError(f"mask must be of bool or uint8, not {mask.dtype}")
    if mask.shape != shape:
        raise UsageError(f"mask has shape {mask.shape}, but the array {shape}")
    if _repeats(mask):
        raise UsageError("a mask that repeats its values (numpy.broadcast_to) must be copied")
    return mask


def _repeats(array):
    return any(step == 0 and size > 1 for step, size in zip(array.strides, array.shape))


def _evenly_spaced(coordinate, name):
    """The distance and the first value of a coordinate of xarray."""
    values = np.asarray(coordinate)
    if values.dtype.kind not in "iuf":
        return 1.0, 0.0
    values = values.astype(float)
    if len(values) < 2:
        return 1.0, float(values[0]) if len(values) else 0.0
    steps = np.diff(values)
    step = (values[-1] - values[0]) / (len(values) - 1)
    if not step or not np.allclose(steps, step, rtol=1e-3, atol=0):
        raise UsageError(f"the coordinates of {name!r} are not evenly spaced; give spacing")
    return float(step), float(values[0])


class Samples:
    """An array [z, y, x] and its place in world space."""

    def __init__(
        self, array, *, spacing=None, origin=None, direction=None, unit=None, mask=None,
        nodata=None, wide=False,
    ):
        if _is_xarray(array):
            array, spacing, origin, direction, unit = _of_xarray(
                array, spacing, origin, direction, unit
            )
        if _is_volume(array):
            spacing = array.spacing if spacing is None else spacing
            origin = array.origin if origin is None else origin
            direction = array.direction if direction is None else direction
            unit = array.unit if unit is None else unit
        if isinstance(array, np.ma.MaskedArray):
            raise TypeError(
                "array is a numpy.ma.MaskedArray; give array.data and "
                "mask=~numpy.ma.getmaskarray(array)"
            )
        array = _in_memory_or_lazy(array)
        self.shape = _check_shape(array.shape)
        self.dtype = check_dtype(array.dtype, wide=wide)
        if isinstance(array, np.ndarray) and array.dtype != self.dtype:
            raise UsageError(
                f"array has the byte order of another machine (dtype {array.dtype.str!r}); use "
                "array.astype(array.dtype.newbyteorder('='))"
            )
        self.array = array
        self.mask = _checked_mask(mask, self.shape)
        self.nodata = None if nodata is None else number(nodata, "nodata")
        samples = np.dtype("uint8") if self.dtype == np.dtype("?") else self.dtype
        self.reader = None if self.in_memory else BlockReader(array, samples)
        self.transform = transform(spacing, origin, direction, unit or "")

    @property
    def in_memory(self):
        return isinstance(self.array, np.ndarray) and not _repeats(self.array)

    def extractor(self):
        """The extractor of the C++ layer."""
        if self.in_memory:
            return _isobrick.ArrayExtractor.of_array(self.array, self.transform, self.nodata, self.mask)
        return _isobrick.ArrayExtractor.of_function(
            self.reader, self.shape, self.reader.dtype.name, self.transform, self.nodata, self.mask
        )

    def set_memory(self, memory):
        """Shares a budget in bytes with what reads blocks. Returns how much of it that takes."""
        return 0 if self.in_memory else self.reader.set_memory(memory // 4)

    def convert(self, path, options, report):
        """Writes a store."""
        if self.in_memory:
            return _isobrick.convert_array(
                self.array, self.transform, self.nodata, self.mask, path, options, report
            )
        return _isobrick.convert_function(
            self.reader, self.shape, self.reader.dtype.name, self.set_memory(options.memory),
            self.transform, self.nodata, self.mask, path, options, report,
        )


def _in_memory_or_lazy(array):
    """A NumPy array without a copy where there is memory, else what can be read by blocks."""
    if isinstance(array, np.ndarray):
        return array
    if is_on_device(array):
        raise TypeError(
            f"array ({type(array).__name__}) is in the memory of a device; copy it to the host"
        )
    if hasattr(array, "__dlpack_device__"):
        return np.from_dlpack(array)
    is_lazy = all(hasattr(array, name) for name in ("shape", "dtype", "__getitem__"))
    if is_lazy and not hasattr(array, "__array_interface__"):
        return array
    return np.asarray(array)


def _is_volume(array):
    """Whether it is an opened `Volume`, which knows its place."""
    return type(array).__module__ == __package__ and hasattr(array, "save_mesh")


def _is_xarray(array):
    return type(array).__module__.startswith("xarray.") and hasattr(array, "coords")


def _of_xarray(array, spacing, origin, direction, unit):
    """What a DataArray has, where it is not given."""
    if array.ndim == 3:
        places = []
        for axis in array.dims:
            if axis in array.coords and spacing is None:
                places.append(_evenly_spaced(array.coords[axis], axis))
            else:
                places.append((1.0, 0.0))
        steps = [abs(step) for step, _ in places]
        signs = [-1.0 if step < 0 else 1.0 for step, _ in places]
        if spacing is None:
            spacing = steps[::-1]
            if direction is None and min(signs) < 0:
                direction = np.diag(signs[::-1])
            if origin is None:
                origin = [first for _, first in places][::-1]
        if unit is None:
            unit = next(
                (
                    name
                    for axis in array.dims[::-1]
                    if axis in array.coords
                    and (name := _isobrick.unit_name(str(array.coords[axis].attrs.get("units", ""))))
                ),
                None,
            )
    return _data_of(array), spacing, origin, direction, unit


def _data_of(array):
    """The samples of a DataArray: those in memory, those of dask, or itself where neither is."""
    if array.chunks is not None or isinstance(getattr(array.variable, "_data", None), np.ndarray):
        return array.data
    return array

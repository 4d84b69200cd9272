"""Checks and conversions of arguments that several functions take."""

import math
import operator
import os

from . import _isobrick
from ._errors import UsageError

_UNITS = {"": 1, "k": 2**10, "m": 2**20, "g": 2**30, "t": 2**40}


def one_line(value):
    """A value for a message."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else text[:79] + "…"


def integer(value, name, least=-(2**63), most=2**63 - 1):
    try:
        result = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} must be an integer, not {type(value).__name__}") from None
    if not least <= result <= most:
        bound = f"at least {least}" if result < least else f"at most {most}"
        raise UsageError(f"{name} must be {bound}, not {result}")
    return result


def text_or_none(value, name):
    if not isinstance(value, (str, type(None))):
        raise TypeError(f"{name} must be a text, not {value!r}")
    return value


def unit_text(unit):
    """The name of a unit of length; "" for None and ""."""
    if not text_or_none(unit, "unit"):
        return ""
    name = _isobrick.unit_name(unit)
    if not name:
        raise UsageError(f"{unit!r} is no unit of length; those are {_isobrick.unit_names()}")
    return name


def check_names(function, given, allowed):
    """Refuses arguments that a function does not have."""
    for name in given:
        if name not in allowed:
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}")


def number(value, name):
    """A float that is not NaN."""
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be a number, not {one_line(value)}") from None
    except OverflowError:
        raise UsageError(f"{name} is larger than any float64") from None
    if math.isnan(result):
        raise UsageError(f"{name} is not a number (NaN)")
    return result


def numbers(values, count, name):
    """A tuple of so many floats."""
    try:
        result = tuple(float(value) for value in values)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be {count} numbers, not {one_line(values)}") from None
    except OverflowError:
        raise UsageError(f"{name} must be finite, not {one_line(values)}") from None
    if len(result) != count:
        raise UsageError(f"{name} must be {count} numbers, not {len(result)}")
    if not all(map(math.isfinite, result)):
        raise UsageError(f"{name} must be finite, not {result}")
    return result


def integers_of(values, count, name, axes=""):
    """A tuple of so many integers."""
    try:
        result = tuple(integer(value, name) for value in values)
    except TypeError:
        raise TypeError(f"{name} must be {count} integers{axes}, not {one_line(values)}") from None
    if len(result) != count:
        raise UsageError(f"{name} must be {count} integers{axes}, not {len(result)}")
    return result


def integers(values, name):
    """A tuple of three integers."""
    return integers_of(values, 3, name, " [z, y, x]")


def histogram_bins(bins):
    bins = integer(bins, "bins")
    if not 1 <= bins <= 1 << 16:
        raise UsageError(f"bins must be 1 to 65536, not {bins}")
    return bins


def one_isovalue(text, values):
    """The only one of the isovalues of a text."""
    if len(values) != 1:
        raise UsageError(
            f"{text!r} means {len(values)} isovalues; one is needed here: isovalues() gives a list"
        )
    return values[0]


def is_list(isovalue):
    """Whether it is several isovalues."""
    if isinstance(isovalue, (list, tuple, range)):
        return True
    return getattr(isovalue, "ndim", 0) == 1


def byte_count(value, name="memory"):
    """Bytes, from a number or a text such as "512M"."""
    if isinstance(value, str):
        text = value.strip().lower().removesuffix("ib").removesuffix("b")
        digits, unit = (text[:-1], text[-1]) if text[-1:] in _UNITS else (text, "")
        try:
            value = int(float(digits) * _UNITS[unit])
        except (ValueError, KeyError, OverflowError):
            raise UsageError(f'{name} must be bytes such as 2**30 or "1G", not {value!r}') from None
    value = integer(value, name)
    if not 0 < value < 2**63:
        raise UsageError(f"{name} must be a positive number of bytes, not {value}")
    return value


def thread_count(value):
    value = integer(value, "threads")
    if not 0 <= value <= 4096:
        raise UsageError(f"threads must be 0 (all cores) to 4096, not {value}")
    return value


def path_text(path):
    text = os.fspath(path)
    return os.fsdecode(text)


def transform(spacing=None, origin=None, direction=None, unit=""):
    """The place of the samples in world space."""
    result = _isobrick.Transform()
    if spacing is not None:
        result.spacing = numbers(spacing, 3, "spacing")
        if min(result.spacing) <= 0:
            raise UsageError(f"spacing must be positive, not {result.spacing}")
    if origin is not None:
        result.origin = numbers(origin, 3, "origin")
    if direction is not None:
        rows = [value for row in direction for value in (row if hasattr(row, "__iter__") else [row])]
        result.direction = numbers(rows, 9, "direction")
        check_rotation(result.direction)
    result.unit = unit_text(unit)
    return result


def check_rotation(m):
    columns = [m[0::3], m[1::3], m[2::3]]
    for i in range(3):
        for j in range(i, 3):
            dot = sum(a * b for a, b in zip(columns[i], columns[j]))
            if abs(dot - (i == j)) > 1e-3:
                raise UsageError("direction must be a rotation: its columns are not orthonormal")


def slices_of(roi):
    """Three slices [z, y, x] without steps."""
    if isinstance(roi, slice) or not hasattr(roi, "__len__"):
        roi = (roi,)
    if len(roi) > 3 or not all(isinstance(part, slice) for part in roi):
        raise TypeError(f"roi must be slices [z, y, x] such as numpy.s_[0:10, :, 5:], not {roi!r}")
    if any(part.step not in (None, 1) for part in roi):
        raise UsageError("roi takes slices without a step")
    return tuple(roi) + (slice(None),) * (3 - len(roi))


def box_of(roi, shape):
    """((z, y, x), (z, y, x)) from three slices, within the shape; None for None."""
    if roi is None:
        return None
    lo, hi = [], []
    for part, size in zip(slices_of(roi), shape):
        begin, end, _ = part.indices(size)
        lo.append(begin)
        hi.append(end)
    if any(end <= begin for begin, end in zip(lo, hi)):
        raise UsageError(f"roi {roi} has no samples in an array of shape {tuple(shape)}")
    return tuple(lo), tuple(hi)


def extract_options(
    isovalue, *, box=None, level=0, normals=False, inside=None, drop_degenerate=False,
    topology="consistent", cap=False, memory=2**30, threads=0, backend="auto", gpu_memory=0,
    device=0,
):
    options = _isobrick.ExtractOptions()
    options.isovalue = number(isovalue, "isovalue")
    options.roi = box
    options.level = integer(level, "level", 0, 64)
    options.normals = bool(normals)
    if inside not in (None, "above", "below"):
        raise UsageError(f"inside must be 'above', 'below' or None, not {inside!r}")
    options.inside = None if inside is None else getattr(_isobrick.Inside, inside)
    options.drop_degenerate = bool(drop_degenerate)
    if topology not in ("consistent", "trilinear"):
        raise UsageError(f"topology must be 'consistent' or 'trilinear', not {topology!r}")
    options.topology = getattr(_isobrick.Topology, topology)
    options.cap = bool(cap)
    options.memory = byte_count(memory)
    options.threads = thread_count(threads)
    if backend not in ("auto", "cpu", "cuda"):
        raise UsageError(f"backend must be 'auto', 'cpu' or 'cuda', not {backend!r}")
    options.backend = getattr(_isobrick.Backend, backend)
    options.gpu_memory = byte_count(gpu_memory, "gpu_memory") if gpu_memory else 0
    options.device = integer(device, "device", 0, 2**31 - 1)
    return options


def label_options(
    labels, *, background=0, level=0, box=None, smooth=0, pass_band=0.1, memory=2**30, threads=0,
):
    """Which labels get a mesh: None, all but the background; a label, or a list of them."""
    options = _isobrick.LabelOptions()
    if labels is not None:
        chosen = list(labels) if is_list(labels) else [labels]
        if not chosen:
            raise UsageError("labels is empty; None stands for all labels")
        for label in chosen:
            label = integer(label, "labels", -(2**63), 2**64 - 1)
            options.add_labels(label, label)
    options.background = integer(background, "background", -(2**63), 2**64 - 1)
    options.level = integer(level, "level", 0, 64)
    options.roi = box
    options.smooth = integer(smooth, "smooth", 0, 6)
    options.pass_band = number(pass_band, "pass_band")
    options.memory = byte_count(memory)
    options.threads = thread_count(threads)
    return options


def filter_options(
    *, min_component=0, largest=0, smooth=0, pass_band=0.1, simplify=None, max_error=None,
    measure=False, threads=0,
):
    """What is done to a mesh on its way to a file or to memory."""
    options = _isobrick.MeshFilterOptions()
    options.min_component = integer(min_component, "min_component", 0)
    options.largest = integer(largest, "largest", 0)
    if options.min_component and options.largest:
        raise UsageError("min_component and largest both choose components: give one of them")
    options.smooth = integer(smooth, "smooth", 0, 10000)
    options.pass_band = number(pass_band, "pass_band")
    if not 0 < options.pass_band <= 0.8:
        raise UsageError(f"pass_band must be above 0 and at most 0.8, not {options.pass_band}")
    if hasattr(simplify, "__index__") and simplify > 1:
        options.simplify_triangles = integer(simplify, "simplify")
    elif simplify is not None:
        options.simplify_ratio = number(simplify, "simplify")
        if not 0 < options.simplify_ratio <= 1:
            raise UsageError(
                "simplify must be a ratio above 0 and at most 1, or a number of triangles, not "
                f"{simplify!r}"
            )
    if max_error is not None:
        options.max_error = number(max_error, "max_error")
        if not 0 < options.max_error < float("inf"):
            raise UsageError(f"max_error must be a length above 0, not {max_error!r}")
    options.threads = thread_count(threads)
    options.measure = bool(measure)
    return options


def attribute_name(name):
    if not isinstance(name, str):
        raise TypeError(f"the name of an attribute must be a text, not {name!r}")
    return name


def colour_arguments(colour_by, colour_map, names, range_of):
    """What the C++ layer takes as colours of an attribute; None: none.

    `names` are those of the attributes. `range_of(name)` is asked where no range is given; None or
    equal values are not enough.
    """
    if colour_by is None:
        if colour_map is not None:
            raise UsageError("colour_map is of colour_by: name an attribute")
        return None
    if isinstance(colour_by, str):
        name, ends = colour_by, None
    else:
        try:
            name, *ends = colour_by
        except TypeError:
            ends = ()
        if len(ends) != 2:
            raise UsageError(
                "colour_by must be the name of an attribute, or (name, low, high), not "
                f"{colour_by!r}"
            )
    if name not in names:
        raise UsageError(f"colour_by: there is no attribute {name!r}")
    if ends is None:
        ends = range_of(name)
        if ends is None or not (-math.inf < ends[0] < ends[1] < math.inf):
            raise UsageError(
                f"colour_by: the range of {name!r} is not known, or is a single value: give it, as "
                f"in ({name!r}, 0, 1)"
            )
    low, high = (number(end, "colour_by") for end in ends)
    return name, low, high, "viridis" if colour_map is None else str(colour_map)


def mesh_file_options(
    *, force=False, quantize=False, compress=False, threads=0, memory=2**30, levels=None,
    sharded=False,
):
    options = _isobrick.MeshFileOptions()
    options.levels = 0 if levels is None else integer(levels, "levels", 1, 2**31 - 1)
    options.sharded = bool(sharded)
    options.force = bool(force)
    options.quantize = bool(quantize)
    options.compress = bool(compress)
    options.threads = thread_count(threads)
    options.memory = byte_count(memory)
    return options

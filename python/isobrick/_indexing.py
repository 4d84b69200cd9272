"""Indices as NumPy takes them, for samples that are read box by box."""

import operator

import numpy as np


def read_indexed(index, shape, dtype, read):
    """The samples of `index`, slices with any steps and integers, as a new array [z, y, x].

    `read` takes three slices without steps: the box that covers what is asked for.
    """
    parts = index if isinstance(index, tuple) else (index,)
    ellipses = [i for i, part in enumerate(parts) if part is Ellipsis]
    if len(ellipses) > 1:
        raise IndexError("an index has one ellipsis at most")
    if ellipses:
        at = ellipses[0]
        parts = parts[:at] + (slice(None),) * (4 - len(parts)) + parts[at + 1 :]
    if len(parts) > 3:
        raise IndexError(f"there are three axes [z, y, x], not {len(parts)}")
    parts += (slice(None),) * (3 - len(parts))
    box, within, extent = [], [], []
    for part, size in zip(parts, shape):
        if isinstance(part, slice):
            chosen = range(*part.indices(size))
            extent.append(len(chosen))
            lo, hi = min(chosen, default=0), max(chosen, default=-1)
            box.append(slice(lo, hi + 1))
            within.append(slice(None, None, part.step))
            continue
        if isinstance(part, (bool, np.bool_)) or not hasattr(part, "__index__"):
            raise TypeError(f"indices are integers and slices, not {part!r}")
        place = operator.index(part)
        if not -size <= place < size:
            raise IndexError(f"index {place} is outside of an axis of {size} samples")
        box.append(slice(place % size, place % size + 1))
        within.append(0)
    if 0 in extent:
        return np.empty(extent, dtype)
    return read(tuple(box))[tuple(within)]

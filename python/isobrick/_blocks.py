"""Reads arrays that are not in memory, box by box."""

import itertools
import threading
from collections import OrderedDict

import numpy as np

# Fewer chunks than the corners of a box touch are of no use.
_LEAST_ROOM = 8


class BlockReader:
    """Gives the samples of boxes of an array with `shape`, `dtype` and `__getitem__`.

    The chunks of dask and zarr are read whole and kept for the next boxes, which share them, as
    many as fit the memory that `set_memory` allows.
    """

    def __init__(self, array, dtype):
        self.array = array
        self.dtype = dtype
        self.bounds = _chunk_bounds(array)
        self.kept = OrderedDict()
        self.room = 0
        self.lock = threading.Lock()  # extractors are shared by threads

    def set_memory(self, memory):
        """Sets a budget in bytes. Returns how much of it the chunks may take."""
        if self.bounds is None:
            return 0
        samples = np.prod([np.diff(bounds).max() for bounds in self.bounds], dtype=float)
        room = int(memory // (samples * self.dtype.itemsize))
        room = room if room >= _LEAST_ROOM else 0
        with self.lock:
            self.room = room
            while len(self.kept) > room:
                self.kept.popitem(last=False)
        return memory if room else 0

    def __call__(self, lo, hi):
        """The samples of a box as a new array [z, y, x]."""
        with self.lock:
            if not self.room:
                return self._read([tuple(map(slice, lo, hi))])[0]
            return self._join(lo, hi)

    def _join(self, lo, hi):
        """The samples of a box out of chunks."""
        out = np.empty([end - begin for begin, end in zip(lo, hi)], self.dtype)
        for chunk, samples in self._chunks(lo, hi):
            first = [bounds[i] for bounds, i in zip(self.bounds, chunk)]
            begin = [max(a, b) for a, b in zip(lo, first)]
            end = [min(a, b + size) for a, b, size in zip(hi, first, samples.shape)]
            to = tuple(slice(b - o, e - o) for b, e, o in zip(begin, end, lo))
            of = tuple(slice(b - o, e - o) for b, e, o in zip(begin, end, first))
            out[to] = samples[of]
        return out

    def _chunks(self, lo, hi):
        """The chunks of a box: their numbers and samples. Missing ones are read together."""
        numbers = [
            range(np.searchsorted(bounds, begin, "right") - 1, np.searchsorted(bounds, end))
            for bounds, begin, end in zip(self.bounds, lo, hi)
        ]
        chunks = list(itertools.product(*numbers))
        for i in range(0, len(chunks), self.room // 2):
            some = chunks[i : i + self.room // 2]
            missing = [chunk for chunk in some if chunk not in self.kept]
            for chunk in set(some).difference(missing):
                self.kept.move_to_end(chunk)
            while len(self.kept) + len(missing) > self.room:
                self.kept.popitem(last=False)
            for chunk, samples in zip(missing, self._read([self._slices(c) for c in missing])):
                self.kept[chunk] = samples
            for chunk in some:
                yield chunk, self.kept[chunk]

    def _slices(self, chunk):
        return tuple(slice(b[i], b[i + 1]) for b, i in zip(self.bounds, chunk))

    def _read(self, boxes):
        blocks = [self.array[box] for box in boxes]
        if blocks and hasattr(blocks[0], "__dask_graph__"):
            import dask

            blocks = dask.compute(*blocks)
        return [np.ascontiguousarray(block, self.dtype) for block in blocks]


def _chunk_bounds(array):
    """Where chunks begin and end along z, y, x, for dask and zarr; None where there are none."""
    chunks = getattr(array, "chunks", None)
    if not chunks or len(chunks) != 3:
        return None
    try:
        if all(isinstance(size, int) for size in chunks):
            return [
                [*range(0, size, max(1, step)), size] for size, step in zip(array.shape, chunks)
            ]
        bounds = [[0, *np.cumsum(sizes).tolist()] for sizes in chunks]
    except (TypeError, ValueError):
        return None
    return bounds if [b[-1] for b in bounds] == list(array.shape) else None

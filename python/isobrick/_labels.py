"""Meshes of the labels of arrays."""

import numpy as np

from ._arguments import box_of, label_options
from ._errors import UsageError
from ._mesh import meshes_of
from ._progress import reporting
from ._samples import Samples
from ._volume import Volume


class _Widened:
    """64-bit integers as float64, which holds all up to 2⁵³."""

    def __init__(self, array):
        self._array = array
        self.shape = array.shape
        self.dtype = np.dtype("float64")
        self.ndim = len(array.shape)

    def __getitem__(self, index):
        integers = np.asarray(self._array[index])
        samples = integers.astype("float64")
        if not np.array_equal(samples.astype(integers.dtype), integers):
            raise UsageError("a label is beyond 2**53")
        return samples


def extract_labels(
    array, labels=None, *, spacing=None, origin=None, direction=None, unit=None, mask=None,
    nodata=None, roi=None, background=0, smooth=0, pass_band=0.1, memory=2**30, threads=0,
    progress=None,
):
    """Closed meshes of the labels of a segmentation: a dictionary from labels to `Mesh`.

    All meshes are made in one pass over the samples, whatever the number of labels. Where two
    labels meet, both meshes have the same triangles, oppositely oriented. The mesh of a label does
    not depend on which others are chosen.

    Parameters
    ----------
    array, spacing, origin, direction, unit, mask, nodata
        As of `Extractor`: an array [z, y, x], also of 64-bit integers. Missing samples have no
        label. Or a `Volume`, of which only what follows counts.
    labels : int or list of int, optional
        None: all but `background`.
    roi : slices [z, y, x], optional
        Only these samples, such as `numpy.s_[0:10, :, 5:]`. Objects end half a sample beyond them.
    background : int
        Gets no mesh unless `labels` names it.
    smooth : int
        Iterations of smoothing, at most 6. Walls between labels still coincide.
    pass_band : float
        Of the smoothing: what varies more along the surface goes, from 0, all, to 0.8, little.
    memory, threads, progress
        As of `Extractor.extract`.

    Examples
    --------
    >>> import numpy as np, isobrick
    >>> cells = isobrick.synth("cells", shape=(64, 64, 64), dtype="uint16")
    >>> meshes = isobrick.extract_labels(cells, smooth=3)
    >>> len(meshes), sorted(meshes)[:3]
    (125, [1, 2, 3])
    """
    if isinstance(array, Volume):
        return array.extract_labels(
            labels, roi=roi, background=background, smooth=smooth, pass_band=pass_band,
            memory=memory, threads=threads, progress=progress,
        )
    if np.dtype(getattr(array, "dtype", object)) in (np.dtype("int64"), np.dtype("uint64")):
        array = _Widened(array)
    samples = Samples(
        array, spacing=spacing, origin=origin, direction=direction, unit=unit, mask=mask,
        nodata=nodata,
    )
    options = label_options(
        labels, background=background, box=box_of(roi, samples.shape), smooth=smooth,
        pass_band=pass_band, memory=memory, threads=threads,
    )
    options.memory -= samples.set_memory(options.memory)
    with reporting(progress) as report:
        return meshes_of(samples.extractor().extract_labels(options, report))

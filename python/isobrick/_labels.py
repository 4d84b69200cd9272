"""Meshes of the labels of arrays."""

from ._arguments import box_of, label_options
from ._mesh import meshes_of
from ._progress import reporting
from ._samples import Samples
from ._volume import Volume


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
        As of `Extractor`: an array [z, y, x], also of 64-bit integers. Where `mask` or `nodata` is
        given labels are integers of 53 bits. Missing samples have no label. Or a `Volume`, of
        which only what follows counts.
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
    samples = Samples(
        array, spacing=spacing, origin=origin, direction=direction, unit=unit, mask=mask,
        nodata=nodata, wide=True,
    )
    options = label_options(
        labels, background=background, box=box_of(roi, samples.shape), smooth=smooth,
        pass_band=pass_band, memory=memory, threads=threads,
    )
    options.memory -= samples.set_memory(options.memory)
    with reporting(progress) as report:
        return meshes_of(samples.extractor().extract_labels(options, report))

"""Surfaces that many tasks make: pieces, and what puts them together."""

from . import _isobrick
from ._arguments import (
    byte_count, filter_options, integer, mesh_file_options, path_text, thread_count,
)
from ._errors import UsageError
from ._mesh import Mesh, meshes_of, with_measure
from ._progress import reporting

__all__ = ["merge", "merge_labels"]


def part_numbers(part):
    """The two numbers of a part such as (3, 8)."""
    try:
        number, count = part
    except (TypeError, ValueError):
        raise UsageError(f"part must be (number, count), such as (3, 8), not {part!r}") from None
    most = 2**32 - 1
    return integer(number, "part", 0, most), integer(count, "part", 0, most)


def _piece_names(pieces):
    if isinstance(pieces, (str, bytes)):
        raise UsageError("pieces must be a list of files, not one text")
    return [path_text(piece) for piece in pieces]


def merge(
    pieces, path=None, *, min_component=0, largest=0, smooth=0, pass_band=0.1, simplify=None,
    max_error=None, measure=False, memory=2**30, threads=0, progress=None, force=False,
    quantize=False, compress=False, levels=None, sharded=False,
):
    """Puts the pieces of a mesh together, which `Volume.extract_piece` or the program made.

    The mesh is that of `Volume.extract`, byte for byte.

    Parameters
    ----------
    pieces : list of str or path
        All pieces of one mesh, in any order.
    path : str or path, optional
        The mesh file. Pieces and file are streamed, so that the mesh may be larger than memory.
        None: the mesh comes as a `Mesh`.
    min_component, largest, smooth, pass_band, simplify, max_error
        As of `Volume.extract`.
    measure, quantize, compress, levels, sharded, force
        Of a file, as of `Volume.save_mesh` and `Mesh.save`.
    memory, threads, progress
        As of `Volume.extract`.

    Returns a `Mesh`, or of a file a dictionary: vertices, faces, and with `measure` a `Measure`.
    """
    names = _piece_names(pieces)
    filters = filter_options(
        min_component=min_component, largest=largest, smooth=smooth, pass_band=pass_band,
        simplify=simplify, max_error=max_error, threads=threads, measure=measure,
    )
    if path is None:
        if measure:
            raise UsageError("measure is for files: a mesh in memory has Mesh.measure()")
        with reporting(progress) as report:
            return Mesh._of(_isobrick.merge_mesh(names, filters, byte_count(memory), report))
    file = mesh_file_options(
        force=force, quantize=quantize, compress=compress, threads=threads, memory=memory,
        levels=levels, sharded=sharded,
    )
    with reporting(progress) as report:
        return with_measure(
            _isobrick.merge_to_file(names, filters, path_text(path), file, report)
        )


def merge_labels(pieces, *, memory=2**30, threads=0, progress=None):
    """Puts the pieces of labels together, of `Volume.extract_label_piece` or of the program.

    Parameters
    ----------
    pieces : list of str or path
        All pieces of the same labels, in any order.
    memory, threads, progress
        As of `Volume.extract_labels`.

    Returns a dictionary from labels to `Mesh`: that of `Volume.extract_labels`, byte for byte. All
    meshes are in memory; `isobrick merge` streams them to files.
    """
    with reporting(progress) as report:
        return meshes_of(
            _isobrick.merge_labels(
                _piece_names(pieces), byte_count(memory), thread_count(threads), report
            )
        )

"""Meshes of labels from pieces, and lists of labels."""

import numpy as np
import pytest

import isobrick
from conftest import same


@pytest.fixture
def path(tmp_path):
    cells = isobrick.synth("cells", shape=(70, 60, 80), dtype="uint16")
    isobrick.convert(
        cells, tmp_path / "cells.zarr", brick=16, downsampling="mode", spacing=(1, 2, 3), unit="um"
    )
    return tmp_path / "cells.zarr"


def same_meshes(found, expected):
    return list(found) == list(expected) and all(
        same(found[label], expected[label]) and found[label].unit == expected[label].unit
        for label in expected
    )


def pieces_of(volume, folder, count, *arguments, **options):
    paths = [folder / f"{i}of{count}.piece" for i in range(1, count + 1)]
    for i, path in enumerate(paths, 1):
        done = volume.extract_label_piece(path, (i, count), *arguments, force=True, **options)
        assert not done["kept"] and done["bytes"] == path.stat().st_size
    return paths


def test_pieces_become_the_meshes(path, tmp_path):
    volume = isobrick.open(path)
    for arguments, options in (
        ((), {}),
        (([3, 7, 20],), {"smooth": 2}),
        ((), {"roi": np.s_[5:60, :, 10:], "background": 4}),
        ((), {"level": 1}),
    ):
        expected = volume.extract_labels(*arguments, **options)
        assert len(expected) > 2
        paths = pieces_of(volume, tmp_path, 3, *arguments, **options)
        stages = []
        merged = isobrick.merge_labels(
            paths[::-1], progress=lambda stage, done, total: stages.append(stage)
        )
        assert same_meshes(merged, expected)
        assert stages


def test_whole_pieces_are_kept(path, tmp_path):
    volume = isobrick.open(path)
    piece = tmp_path / "1of2.piece"
    first = volume.extract_label_piece(piece, (1, 2))
    again = volume.extract_label_piece(piece, (1, 2))
    assert again["kept"] and again["faces"] == first["faces"] > 1000
    piece.write_bytes(piece.read_bytes()[:-100])
    assert not volume.extract_label_piece(piece, (1, 2))["kept"]


def test_pieces_that_make_no_sense_are_refused(path, tmp_path):
    volume = isobrick.open(path)
    paths = pieces_of(volume, tmp_path, 2)
    with pytest.raises(isobrick.UsageError, match="part"):
        volume.extract_label_piece(tmp_path / "x.piece", 3)
    with pytest.raises(isobrick.UsageError):
        volume.extract_label_piece(tmp_path / "x.piece", (3, 2))
    with pytest.raises(isobrick.UsageError, match="list"):
        isobrick.merge_labels(str(paths[0]))
    with pytest.raises(isobrick.Error):
        isobrick.merge_labels(paths[:1])
    with pytest.raises(isobrick.Error):
        isobrick.merge(paths)  # pieces of labels are no surface
    volume.extract_piece(2.5, tmp_path / "s.piece", (1, 1))
    with pytest.raises(isobrick.Error):
        isobrick.merge_labels([tmp_path / "s.piece"])
    with pytest.raises(isobrick.UsageError, match="memory"):
        isobrick.merge_labels(paths, memory=1000)
    damaged = bytearray(paths[1].read_bytes())
    damaged[len(damaged) // 2] ^= 1
    paths[1].write_bytes(damaged)
    with pytest.raises(isobrick.DamageError):
        isobrick.merge_labels(paths)


def test_lists_of_labels_are_added(path):
    before = isobrick.open(path).extract_labels([3, 7, 20])
    done = isobrick.index(path, "labels")
    assert all(size > 0 for size in done["level_bytes"])
    assert same_meshes(isobrick.open(path).extract_labels([3, 7, 20]), before)
    with pytest.raises(isobrick.UsageError):
        isobrick.index(path, "labels")  # it is there
    isobrick.index(path, "labels", force=True)
    with pytest.raises(isobrick.UsageError, match="leaf"):
        isobrick.index(path, "labels", leaf=8, force=True)
    with pytest.raises(isobrick.UsageError, match="labels"):
        isobrick.index(path, "lists")

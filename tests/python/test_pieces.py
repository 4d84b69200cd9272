"""Volume.extract_piece and merge."""

import numpy as np
import pytest

import isobrick
from conftest import ball, same


@pytest.fixture
def volume(tmp_path):
    """Two tiles and more along each axis."""
    field = np.pad(ball(), 20, mode="edge")
    isobrick.convert(field, tmp_path / "a.zarr", spacing=(1, 2, 3), unit="um")
    return isobrick.open(tmp_path / "a.zarr")


def pieces_of(volume, folder, count, **options):
    """All pieces of a surface."""
    paths = [folder / f"{i}of{count}.piece" for i in range(1, count + 1)]
    for i, path in enumerate(paths, 1):
        done = volume.extract_piece(MIDDLE, path, (i, count), **options)
        assert not done["kept"] and done["bytes"] == path.stat().st_size
    return paths


MIDDLE = "50%"


def test_pieces_become_the_mesh(volume, tmp_path):
    for options in ({}, {"normals": True, "roi": np.s_[5:60, :, 10:]}, {"cap": True}):
        expected = volume.extract(MIDDLE, **options)
        assert len(expected.faces) > 1000
        paths = pieces_of(volume, tmp_path, 3, **options)
        mesh = isobrick.merge(paths[::-1])
        assert same(mesh, expected) and mesh.unit == expected.unit
        for path in paths:
            path.unlink()


def test_whole_pieces_are_kept(volume, tmp_path):
    path = tmp_path / "1of2.piece"
    first = volume.extract_piece(MIDDLE, path, (1, 2))
    again = volume.extract_piece(MIDDLE, path, (1, 2))
    assert again["kept"] and again["faces"] == first["faces"]
    path.write_bytes(path.read_bytes()[:-100])
    assert not volume.extract_piece(MIDDLE, path, (1, 2))["kept"]


def test_files_are_those_of_one_call(volume, tmp_path):
    paths = pieces_of(volume, tmp_path, 4, normals=True)
    volume.save_mesh(tmp_path / "one.ply", MIDDLE, normals=True, largest=1)
    stages = []
    done = isobrick.merge(
        paths, tmp_path / "parts.ply", largest=1, measure=True,
        progress=lambda stage, done, total: stages.append(stage),
    )
    assert (tmp_path / "parts.ply").read_bytes() == (tmp_path / "one.ply").read_bytes()
    assert done["faces"] == done["measure"].faces > 1000
    with pytest.raises(isobrick.UsageError, match="exists"):
        isobrick.merge(paths, tmp_path / "parts.ply")
    small = isobrick.merge(paths, simplify=0.25)
    assert len(small.faces) == pytest.approx(0.25 * done["faces"], rel=0.05)


def test_what_does_not_fit_is_refused(volume, tmp_path):
    paths = pieces_of(volume, tmp_path, 3)
    with pytest.raises(isobrick.UsageError, match="part 2 of 3 is missing"):
        isobrick.merge([paths[0], paths[2]], tmp_path / "m.ply")
    with pytest.raises(isobrick.UsageError, match="a list"):
        isobrick.merge(str(paths[0]))
    with pytest.raises(isobrick.UsageError, match="no pieces"):
        isobrick.merge([])
    with pytest.raises(isobrick.UsageError, match="measure"):
        isobrick.merge(paths, measure=True)
    with pytest.raises(OSError):
        isobrick.merge([tmp_path / "none.piece"])
    data = bytearray(paths[1].read_bytes())
    data[len(data) // 2] ^= 1
    paths[1].write_bytes(data)
    with pytest.raises(isobrick.DamageError, match="2of3"):
        isobrick.merge(paths, tmp_path / "m.ply")
    assert not (tmp_path / "m.ply").exists()
    for part in ((0, 3), (4, 3), 3, (1, 2, 3)):
        with pytest.raises(isobrick.UsageError, match="part"):
            volume.extract_piece(MIDDLE, tmp_path / "x.piece", part)
    assert not (tmp_path / "x.piece").exists()

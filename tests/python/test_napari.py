"""The reader of napari, without napari: the manifest, and the layers that napari would be given."""

import importlib
import re
from pathlib import Path

import numpy as np
import pytest

import isobrick
from conftest import ball
from isobrick._napari import LevelArray, reader_of

MANIFEST = Path(isobrick.__file__).parent / "napari.yaml"


def test_the_manifest_names_what_there_is():
    yaml = pytest.importorskip("yaml")
    manifest = yaml.safe_load(MANIFEST.read_text())
    assert set(manifest) == {"name", "display_name", "contributions"}
    assert manifest["name"] == "isobrick" and 3 <= len(manifest["display_name"]) <= 40
    contributions = manifest["contributions"]
    assert set(contributions) == {"commands", "readers"}
    commands = {command["id"]: command for command in contributions["commands"]}
    for name, command in commands.items():
        assert set(command) == {"id", "title", "python_name"}
        assert re.fullmatch(r"isobrick\.\w+", name)
        module, function = command["python_name"].split(":")
        assert callable(getattr(importlib.import_module(module), function))
    for reader in contributions["readers"]:
        assert set(reader) == {"command", "filename_patterns", "accepts_directories"}
        assert reader["command"] in commands and reader["accepts_directories"] is True
        assert reader["filename_patterns"] == ["*.zarr", "*.zarr.zip"]


def test_layers(tmp_path):
    path = tmp_path / "ball.zarr"
    isobrick.convert(ball(), path, spacing=(0.5, 0.75, 2), origin=(10, -20, 30), unit="mm", brick=16)
    volume = isobrick.open(path)
    ((data, arguments, kind),) = reader_of(str(path))(str(path))
    assert kind == "image" and len(data) == len(volume.levels) > 2 and arguments["multiscale"]
    assert arguments["name"] == "ball"
    assert arguments["scale"] == (2, 0.75, 0.5) and arguments["translate"] == (30, -20, 10)
    assert arguments["contrast_limits"] == volume.range
    assert arguments["metadata"]["unit"] == "millimeter" and "rotate" not in arguments
    for number, level in enumerate(data):
        assert level.shape == volume.levels[number].shape and level.dtype == np.float32
        assert np.array_equal(np.asarray(level), volume.read(number))


def test_rotations_are_in_the_order_of_the_array(tmp_path):
    path = tmp_path / "turned.zarr"
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])  # x to y
    isobrick.convert(ball((10, 11, 12)), path, direction=turn, spacing=(1, 2, 3), levels=1)
    ((data, arguments, _),) = reader_of(path)(path)
    assert isinstance(data, LevelArray) and not arguments["multiscale"]
    index = np.array([1, 2, 3])  # z, y, x
    place = arguments["rotate"] @ (arguments["scale"] * index) + arguments["translate"]
    assert np.allclose(place, [3, 3, -4])


def test_what_other_readers_open(tmp_path, image):
    assert reader_of(str(image[0])) is None
    assert reader_of(str(tmp_path / "none.zarr")) is None
    assert reader_of([str(tmp_path)]) is None
    (tmp_path / "empty.zarr").mkdir()
    assert reader_of(str(tmp_path / "empty.zarr")) is None


@pytest.mark.parametrize("index", [
    np.s_[:], np.s_[5], np.s_[-1], np.s_[3:20, 7, -5:], np.s_[..., 4], np.s_[1, 2, 3],
    np.s_[::2, 1:30:3], np.s_[::-1, 5:2:-1], np.s_[:, 40:], np.s_[:, 5:5], np.s_[2, ..., 3],
    np.s_[np.int64(2), :, 1:2],
])
def test_indices(store, index):
    volume = isobrick.open(store)
    level = LevelArray(volume, 1)
    expected = volume.read(1)[index]
    assert np.array_equal(level[index], expected) and np.shape(level[index]) == np.shape(expected)


def test_indices_that_cannot_be(store):
    level = LevelArray(isobrick.open(store), 0)
    for index in (60, (0, -51), (0, 0, 0, 0)):
        with pytest.raises(IndexError):
            level[index]
    with pytest.raises(TypeError):
        level["a"]


def test_dask_takes_a_level(store):
    dask = pytest.importorskip("dask.array")
    volume = isobrick.open(store)
    level = dask.from_array(LevelArray(volume, 0), chunks=(7, 20, 40))
    assert np.array_equal(level[5:9].compute(), volume[5:9])

"""Pictures of surfaces."""

import io
import signal
import threading
import time

import numpy as np
import pytest

import isobrick
from conftest import ball, can_draw


pytestmark = pytest.mark.skipif(not can_draw(), reason="no OpenGL")

SIZE = (200, 160)
WHITE = dict(size=SIZE, background="white")


def covered(picture):
    """Pixels that are not the white background."""
    return (picture.array != 255).any(axis=2)


def mean_colour(picture):
    return picture.array[covered(picture)].mean(0)


def test_a_ball_is_a_spot_in_the_middle():
    picture = isobrick.render(ball(), 0, **WHITE)
    assert picture.array.shape == (160, 200, 3) and picture.array.dtype == np.uint8
    assert picture.size == SIZE and "200×160" in repr(picture) and picture.renderer
    rows, columns = np.nonzero(covered(picture))
    assert np.ptp(rows) == pytest.approx(np.ptp(columns), abs=4) and 60 < np.ptp(rows) < 150
    assert rows.mean() == pytest.approx(79.5, abs=2) and columns.mean() == pytest.approx(99.5, abs=2)


def test_arrays_meshes_volumes_and_files_look_the_same(tmp_path):
    field = ball()
    isobrick.convert(field, tmp_path / "a.zarr")
    mesh = isobrick.extract(field, 0, normals=True)
    mesh.save(tmp_path / "a.ply")
    pictures = [
        isobrick.render(source, *isovalue, **WHITE)
        for source, *isovalue in (
            (field, 0), (isobrick.Extractor(field), 0), (isobrick.open(tmp_path / "a.zarr"), 0),
            (tmp_path / "a.zarr", 0), (mesh,), (tmp_path / "a.ply",), ([mesh],),
        )
    ]
    for picture in pictures[1:]:
        difference = np.abs(picture.array.astype(int) - pictures[0].array)
        assert (difference.max(2) > 8).mean() < 0.01


def test_the_isovalue_is_suggested(store):
    volume = isobrick.open(store)
    suggested = isobrick.render(volume, **WHITE)
    assert np.array_equal(suggested.array, isobrick.render(volume, "otsu", **WHITE).array)
    with pytest.raises(ValueError, match="equal"):
        isobrick.render(np.zeros((4, 4, 4)))
    coarse = isobrick.render(volume, level=1, **WHITE)
    assert not np.array_equal(coarse.array, suggested.array)


def test_several_surfaces():
    field = ball()
    inner = isobrick.render(field, [10, 0], colour=["#ff0000", "#0000ff"], opacity=[1, 0.3], **WHITE)
    outer = isobrick.render(field, 0, colour="#0000ff", **WHITE)
    alone = isobrick.render(field, 10, colour=(1, 0, 0), **WHITE)
    red, _, blue = mean_colour(alone)
    assert red > 2 * blue
    red, _, blue = mean_colour(outer)
    assert blue > 2 * red
    # The frame is that of both: the middle shows the inner one through the outer one.
    assert covered(inner).sum() == pytest.approx(covered(outer).sum(), rel=0.05)
    middle = inner.array[75:85, 95:105].reshape(-1, 3).mean(0)
    assert middle[0] > 1.2 * middle[2]
    meshes = isobrick.extract(field, [10, 0], normals=True)
    drawn = isobrick.render(meshes, colour=["#ff0000", "#0000ff"], opacity=[1, 0.3], **WHITE)
    assert np.abs(drawn.array.astype(int) - inner.array).mean() < 3


def test_meshes_in_other_units_are_scaled():
    field = ball()
    place = dict(normals=True, origin=(-29.5, -24.5, -19.5))
    small = isobrick.extract(field, 0, unit="mm", **place)
    large = isobrick.extract(field, 0, unit="cm", **place)
    alone = isobrick.render(large, **WHITE)
    both = isobrick.render([small, large], **WHITE)
    assert covered(both).sum() == pytest.approx(covered(alone).sum(), rel=0.05)


def test_options_change_the_picture():
    field = ball()
    plain = isobrick.render(field, 0, unit="mm", **WHITE).array
    for options in (
        {"camera": "azimuth=120,elevation=-10,zoom=2"},
        {"camera": {"from": (1, 1, 0.5), "orthographic": True, "zoom": 2}},
        {"clip": (1, 0, 0, 29.5)},
        {"clip": [(1, 0, 0, 29.5), (0, 0, 1, 19.5)]},
        {"region": ((None, 29.5), None, (0, 20))},
        {"occlusion": False},
        {"box": True},
        {"axes": True},
        {"scale_bar": True},
        {"scale_bar": "um"},
        {"colour": "black"},
        {"opacity": 0.2},
        {"roi": np.s_[20:]},
    ):
        other = isobrick.render(field, 0, unit="mm", **WHITE, **options).array
        assert not np.array_equal(other, plain), options
    two = isobrick.render(field, 0, size=SIZE, background=("#ff0000", (0, 0, 1))).array
    assert two[0, 0, 0] > 200 > two[0, 0, 2] and two[-1, 0, 2] > 200 > two[-1, 0, 0]
    opened = isobrick.render(field, 0, clip=(0, 1, 0, 24.5), edges=True, **WHITE).array
    plain = isobrick.render(field, 0, clip=(0, 1, 0, 24.5), **WHITE).array
    assert not np.array_equal(opened, plain)


def test_notebooks_and_files(tmp_path):
    image = pytest.importorskip("PIL.Image")
    picture = isobrick.render(ball(), 0, size=SIZE)
    assert np.array_equal(np.asarray(image.open(io.BytesIO(picture._repr_png_()))), picture.array)
    assert np.asarray(picture) is picture.array
    assert np.asarray(picture, float).dtype == float
    path = tmp_path / "a.png"
    picture.save(path)
    assert np.array_equal(np.asarray(image.open(path)), picture.array)
    with pytest.raises(ValueError, match="exists"):
        picture.save(path)
    picture.save(path, force=True)
    with pytest.raises(ValueError, match=".png"):
        picture.save(tmp_path / "a.jpg")
    with pytest.raises(FileNotFoundError):
        picture.save(tmp_path / "none" / "a.png")
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.parametrize(
    "arguments, what",
    [
        ({"size": (15, 100)}, "16 to 16384"),
        ({"size": (100, 20000)}, "16 to 16384"),
        ({"size": 100}, "integers"),
        ({"camera": "azimut=3"}, "no part of a camera"),
        ({"camera": "eye=0:0:0,target=0:0:0"}, "eye"),
        ({"camera": 30}, "camera"),
        ({"colour": "reddish"}, "no colour"),
        ({"colour": (1, 2, 3)}, "parts of a colour"),
        ({"colour": ["#ff0000", "#00ff00"]}, "more colours"),
        ({"opacity": 0}, "opacity"),
        ({"opacity": [1, 1]}, "more colours or opacities"),
        ({"background": ["white"] * 3}, "background"),
        ({"clip": (0, 0, 0, 1)}, "direction"),
        ({"clip": [(1, 0, 0, 1)] * 7}, "at most"),
        ({"clip": (1, 0, 0)}, "clip"),
        ({"region": ((1, 0), None, None)}, "empty"),
        ({"region": 3}, "three pairs"),
        ({"scale_bar": "hours"}, "unit of length"),
        ({"scale_bar": "mm"}, "no unit"),
        ({"level": 1}, "level"),
        ({"memory": "1M"}, "too small"),
        ({"isovalue": []}, "no isovalue"),
        ({"isovalue": np.nan}, "NaN"),
        ({"colours": 3}, "colours"),
    ],
)
def test_requests_that_make_no_sense(arguments, what):
    with pytest.raises((TypeError, ValueError), match=what) as error:
        isobrick.render(ball(), **{"isovalue": 0, "size": SIZE, **arguments})
    assert "\n" not in str(error.value)


def test_sources_that_make_no_sense(tmp_path):
    mesh = isobrick.extract(ball(), 0)
    with pytest.raises(ValueError, match="no isovalue"):
        isobrick.render(mesh, 3)
    with pytest.raises(TypeError, match="not both"):
        isobrick.render([mesh, ball()])
    with pytest.raises(ValueError, match="no triangles"):
        isobrick.render(isobrick.extract(ball(), 1000))
    with pytest.raises(FileNotFoundError):
        isobrick.render(tmp_path / "none.ply")
    (tmp_path / "a.ply").write_bytes(b"ply\nformat")
    with pytest.raises(isobrick.Error):
        isobrick.render(tmp_path / "a.ply")
    # A surface that is nowhere is the background.
    assert not covered(isobrick.render(ball(), 1000, **WHITE)).any()


def test_ctrl_c_ends_it():
    field = np.random.default_rng(1).random((400, 400, 400), np.float32)
    begun = time.monotonic()
    timer = threading.Timer(0.5, signal.raise_signal, [signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        isobrick.render(field, 0.5, size=SIZE)
        time.sleep(5)
    assert time.monotonic() - begun < 3


def test_progress():
    stages = []
    isobrick.render(ball(), 0, size=SIZE, progress=lambda stage, *_: stages.append(stage))
    assert stages


def test_threads_draw_at_the_same_time():
    wanted = isobrick.render(ball(), 0, **WHITE).array
    pictures = {}
    threads = [
        threading.Thread(
            target=lambda i=i: pictures.__setitem__(i, isobrick.render(ball(), 0, **WHITE).array)
        )
        for i in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(pictures) == 4
    assert all(np.array_equal(picture, wanted) for picture in pictures.values())

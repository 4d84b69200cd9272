"""Isovalues as texts and lists, of arrays and volumes."""

import numpy as np
import pytest

import isobrick
from conftest import ball, same


def noisy(dtype, seed=1):
    """Two classes of samples."""
    rng = np.random.default_rng(seed)
    field = np.where(ball() > 0, 160.0, 60.0) + rng.normal(0, 12, ball().shape)
    return field.astype(dtype)


def test_otsu_is_that_of_scikit_image():
    filters = pytest.importorskip("skimage.filters")
    for dtype in ("u1", "i2", "u2"):
        field = noisy(dtype)
        # Of whole numbers the isovalue lies between those of the two classes.
        assert isobrick.Extractor(field).isovalue("otsu") == filters.threshold_otsu(field) + 0.5
    for dtype in ("f4", "f8", "i4"):
        field = noisy(dtype) * np.dtype(dtype).type(1000)
        # Bins of the smallest power of two of which at most 65536 are enough.
        width = 2.0 ** (0 if dtype == "i4" else -20)
        while np.floor(field.max() / width) - np.floor(field.min() / width) >= 1 << 16:
            width *= 2
        first = np.floor(field.min() / width) * width
        edges = np.arange(first, field.max() + width, width)
        counts, _ = np.histogram(field, edges)
        centres = edges[:-1] + width / 2
        wanted = filters.threshold_otsu(hist=(counts, centres)) + width / 2
        assert isobrick.Extractor(field).isovalue("otsu") == pytest.approx(wanted, abs=width / 2)


def test_texts_mean_what_they_mean_of_a_volume(tmp_path):
    for i, dtype in enumerate(("u1", "i2", "i4", "f4", "f8")):
        field = noisy(dtype)
        isobrick.convert(field, tmp_path / f"{i}.zarr")
        volume, extractor = isobrick.open(tmp_path / f"{i}.zarr"), isobrick.Extractor(field)
        texts = ["otsu", "p99.5", "p0", "50%", "70", "60:120:20", "otsu,p90"]
        if dtype != "u1":
            texts += ["300HU", "ct-bone"]
        for text in texts:
            assert extractor.isovalues(text) == volume.isovalues(text), (dtype, text)
        assert extractor.suggested_isovalue() == volume.suggested_isovalue()
    assert same(isobrick.extract(field, "otsu"), volume.extract("otsu"))


def test_values_of_texts():
    field = np.arange(1000, dtype=np.float32).reshape(10, 10, 10)
    extractor = isobrick.Extractor(field)
    assert extractor.isovalue("50%") == pytest.approx(499.5)
    assert extractor.isovalue("p90") == pytest.approx(np.percentile(field, 90), abs=1)
    assert extractor.isovalue(3) == 3 and extractor.isovalues("1,2,2") == [1, 2]
    assert extractor.isovalue("ct-bone") == 226
    flags = ball() > 0
    assert isobrick.Extractor(flags).isovalue("otsu") == 0.5
    assert same(isobrick.extract(flags, "otsu"), isobrick.extract(flags, 0.5))


@pytest.mark.parametrize("order", ["C", "F"])
def test_any_strides_and_blocks(order):
    field = np.asarray(noisy("i2"), order=order)
    wanted = isobrick.Extractor(field.copy()).histogram(1 << 16)
    for view in (field[::-1], field.transpose(2, 0, 1), field[..., ::-1]):
        assert np.array_equal(isobrick.Extractor(view).histogram(1 << 16).counts, wanted.counts)
    assert wanted.counts.sum() == field.size and (wanted.lo, wanted.hi) == (field.min(), field.max())
    dask = pytest.importorskip("dask.array")
    lazy = isobrick.Extractor(dask.from_array(field, chunks=(13, 17, 19)))
    assert np.array_equal(lazy.histogram(1 << 16).counts, wanted.counts)
    assert same(isobrick.extract(lazy._samples.array, "otsu"), isobrick.extract(field, "otsu"))


def test_missing_samples_do_not_count():
    field = noisy("f4")
    mask = np.ones(field.shape, bool)
    mask[:, :, :20] = False
    holes = np.where(mask, field, np.float32(-9999))
    of_mask = isobrick.Extractor(holes, mask=mask)
    of_nodata = isobrick.Extractor(holes, nodata=-9999)
    of_nan = isobrick.Extractor(np.where(mask, field, np.float32(np.nan)))
    assert of_mask.isovalue("otsu") == of_nodata.isovalue("otsu") == of_nan.isovalue("otsu")
    assert 60 < of_mask.isovalue("otsu") < 160
    assert of_mask.histogram().nan == (~mask).sum()
    assert of_mask.histogram().counts.sum() == mask.sum()


def test_lists_of_isovalues(store):
    field = ball()
    meshes = isobrick.extract(field, [0, 5, "50%"], normals=True)
    assert isinstance(meshes, list) and len(meshes) == 3
    for mesh, isovalue in zip(meshes, (0, 5, isobrick.Extractor(field).isovalue("50%"))):
        assert same(mesh, isobrick.extract(field, isovalue, normals=True))
    volume = isobrick.open(store)
    meshes = volume.extract(["otsu", 100, 100], normals=True, level=1)
    for mesh, isovalue in zip(meshes, ("otsu", 100, 100)):
        assert same(mesh, volume.extract(isovalue, normals=True, level=1))
    assert volume.extract([]) == [] and isobrick.extract(field, ()) == []
    assert len(isobrick.extract(field, np.array([1.0, 2.0]))) == 2
    assert len(volume.extract(volume.isovalues("100:140:20"))) == 3
    for source in (volume, isobrick.Extractor(field)):
        with pytest.raises((TypeError, ValueError)):
            source.extract([[1, 2]])
        with pytest.raises(TypeError):
            source.extract([1, None])


@pytest.mark.parametrize(
    "text, what",
    [
        ("otso", "no isovalue"),
        ("p101", "percentage"),
        ("otsu,p90", "2 isovalues"),
        ("", "no isovalue"),
        ("300HU", "Hounsfield"),
    ],
)
def test_texts_that_make_no_sense(text, what):
    with pytest.raises(isobrick.UsageError, match=what) as error:
        isobrick.extract(noisy("u1"), text)
    assert "\n" not in str(error.value)


def test_arrays_without_a_threshold():
    with pytest.raises(isobrick.UsageError, match="all samples are"):
        isobrick.extract(np.ones((4, 4, 4), np.uint8), "otsu")
    with pytest.raises(isobrick.UsageError, match="finite"):
        isobrick.extract(np.full((4, 4, 4), np.nan, np.float32), "otsu")
    assert isobrick.Extractor(np.ones((4, 4, 4), np.uint8)).suggested_isovalue() is None


def test_huge_isovalues():
    for isovalue in (10**400, -(10**400)):
        with pytest.raises(isobrick.UsageError, match="float64"):
            isobrick.extract(ball(), isovalue)
    for isovalue in (1e300, -1e300, 2**64):
        assert len(isobrick.extract(ball(), isovalue)) == 0

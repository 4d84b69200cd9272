"""Compares stored histograms and what they give with NumPy and scikit-image.

  python3 check_thresholds.py ISOBRICK PRINT_THRESHOLDS

Exit status: 0 equal, 1 different, 77 NumPy or scikit-image is not installed.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

try:
    import numpy
    from skimage.filters import threshold_otsu
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

PERCENTS = [0, 0.5, 25, 50, 90, 99.5, 100]
EXTENT = (40, 50, 60)  # z, y, x


def volumes():
    """Samples of a background and an object, of several types."""
    random = numpy.random.default_rng(3)
    is_object = random.random(EXTENT) < 0.3
    scan = numpy.where(is_object, random.normal(150, 20, EXTENT), random.normal(60, 12, EXTENT))
    yield "uint8", scan.clip(0, 255)
    yield "int8", (scan - 100).clip(-128, 127)
    yield "uint16", scan * 100
    yield "int16", scan * 20 - 1024
    yield "int32", scan * 1e7 - 1e9
    yield "float32", scan / 70
    yield "float64", scan * 1e-30


def check(samples, isobrick, print_thresholds, folder):
    """The first difference, or nothing."""
    z, y, x = EXTENT
    raw = folder / f"v_{x}x{y}x{z}_{samples.dtype}.raw"
    samples.tofile(raw)
    store = folder / f"{samples.dtype}.zarr"
    subprocess.run([isobrick, "convert", raw, store, "--quiet"], check=True)
    found = json.loads(subprocess.run([print_thresholds, store, *map(str, PERCENTS)], check=True,
                                      capture_output=True, text=True).stdout)
    first, width = found["first"], found["bin_width"]
    counts = numpy.array(found["counts"])
    bins = numpy.floor(samples.astype(float) / width).astype(int) - round(first / width)
    if not numpy.array_equal(numpy.bincount(bins.ravel()), counts):
        return "other counts"
    whole = samples.dtype.kind in "iu"
    centres = first + width * (numpy.arange(counts.size) + (0 if whole else 0.5))
    centres += (width - 1) / 2 if whole else 0
    expected = threshold_otsu(hist=(counts, centres))
    # Neighbouring bins of thousands differ by less than the rounding of sums of thousands.
    if abs(found["otsu"] - expected) > (0 if counts.size <= 256 else 1e-3 * counts.size * width):
        return f"Otsu's threshold is {found['otsu']}, not {expected}"
    exact = whole and width == 1
    for percent, value in zip(PERCENTS, found["percentiles"]):
        sample = numpy.percentile(samples, percent, method="inverted_cdf")
        if abs(value - float(sample)) > (0 if exact else width):
            return f"percentile {percent} is {value}, not {sample}"
    return None


def main() -> int:
    isobrick, print_thresholds = sys.argv[1:]
    failures = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, values in volumes():
            difference = check(values.astype(name), isobrick, print_thresholds,
                               pathlib.Path(folder))
            print(f"{name}: {difference or 'equal'}")
            failures += difference is not None
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())

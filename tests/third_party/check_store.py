"""Opens an OME-Zarr store with TensorStore and compares arrays with raw files.

  python3 check_store.py STORE ARRAY=RAW ...

RAW holds the array's samples, C order, little endian. Exit status: 0 equal,
1 different, 77 TensorStore is not installed.
"""

import pathlib
import sys

try:
    import numpy
    import tensorstore
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)


def main() -> int:
    store, *pairs = sys.argv[1:]
    for pair in pairs:
        name, _, raw = pair.partition("=")
        spec = {
            "driver": "zarr3",
            "kvstore": {"driver": "file", "path": str(pathlib.Path(store).resolve() / name) + "/"},
        }
        array = tensorstore.open(spec, read=True).result()
        samples = numpy.ascontiguousarray(array.read().result())
        if samples.tobytes() != pathlib.Path(raw).read_bytes():
            print(f"{store}/{name}: differs")
            return 1
    print(f"{store}: {len(pairs)} arrays equal")
    return 0


if __name__ == "__main__":
    sys.exit(main())

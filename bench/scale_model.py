#!/usr/bin/env python3
"""How long extraction takes at sizes and numbers of machines that nobody has at hand.

scale_model.py ISOBRICK FOLDER [--threads 16] [--calibrate 256,512] [--check 1024,2048]
  [--frequencies 1,4,16] [--turns 3]

The model is t = fixed + a * bytes decoded + b * active blocks + c * bytes written. Its rates are
measured on small gyroids with more and with less surface, and it is checked on large ones, which
have no part in them. What it needs of a volume is in `extract --estimate`, which reads ranges and a
sample of the bricks. Then the table of larger volumes and more machines, which nobody measured:
each machine has its part of the bricks, once more those that it shares with others, and a file
system that takes as many bytes a second as machines write.
"""
import argparse
import json
import pathlib
import subprocess
import time

import numpy as np


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("isobrick")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--threads", type=int, default=16)
    parser.add_argument("--calibrate", default="256,512")
    parser.add_argument("--check", default="1024")
    parser.add_argument("--frequencies", default="1,4,16", help="periods in 256 samples")
    parser.add_argument("--turns", type=int, default=3)
    return parser.parse_args()


class Volumes:
    """Gyroids with what is known of them before they are extracted, and what it took."""

    def __init__(self, arguments):
        self.isobrick = arguments.isobrick
        self.folder = arguments.folder
        self.threads = str(arguments.threads)
        self.turns = arguments.turns

    def store(self, edge, frequency):
        """A gyroid with so many periods in 256 samples."""
        path = self.folder / f"model_{edge}_{frequency}.zarr"
        if not path.exists():
            subprocess.run([self.isobrick, "synth", "gyroid", path, "-q", "--type", "u8", "--noise",
                            "0", "--dims", f"{edge},{edge},{edge}", "--frequency",
                            str(frequency * edge // 256)], check=True)
        return path

    def extract(self, store, *more):
        """The object of the surface."""
        words = [self.isobrick, "extract", store, "--isovalue", "127.5", "--threads", self.threads,
                 "--backend", "cpu", "--json", *more]
        done = subprocess.run(words, check=True, capture_output=True, text=True)
        return json.loads(done.stdout)

    def features(self, store):
        """1, bytes decoded, active blocks, bytes written: all by the estimate."""
        guess = self.extract(store, "--estimate")["surfaces"][0]
        return np.array([1.0, guess["bricks"]["active"] * 64.0**3, guess["active_blocks"],
                         guess["file_bytes"]])

    def measure(self, store):
        """The seconds of the best turn, and the memory that it took."""
        mesh = self.folder / "model.ply"
        best, peak = float("inf"), 0
        for _ in range(self.turns):
            mesh.unlink(missing_ok=True)
            begin = time.perf_counter()
            report = self.extract(store, "-o", str(mesh))
            best = min(best, time.perf_counter() - begin)
            peak = max(peak, report["peak_resident_bytes"])
        mesh.unlink(missing_ok=True)
        return best, peak


def fit(features, seconds):
    """Rates that are not negative, by least squares of relative errors."""
    rows = np.array(features) / np.array(seconds)[:, None]
    used = list(range(rows.shape[1]))
    while True:
        found = np.linalg.lstsq(rows[:, used], np.ones(len(seconds)), rcond=None)[0]
        if (found >= 0).all():
            break
        used.pop(int(np.argmin(found)))
    rates = np.zeros(rows.shape[1])
    rates[used] = found
    return rates


def seconds_of(rates, features, machines):
    """Of so many machines: shared bricks are decoded by each that needs them."""
    fixed, decoded, blocks, written = rates * features
    tiles = max(features[2] / 8, 1) / machines
    shared = 0 if machines == 1 else min(((tiles ** (1 / 3) + 1) ** 3 - tiles) / tiles / 2, 1)
    return fixed + (decoded + blocks) / machines * (1 + shared) + written / machines


def traffic_of(features, machines):
    """Bytes that a machine gets: 24 for each piece, four a machine, and for each tile beside."""
    if machines == 1:
        return 0
    tiles = features[2] / 8 / machines
    return 24 * 4 * machines + 24 * 3 * tiles ** (2 / 3)


def main():
    """Calibration, check, and what follows from both."""
    arguments = parse_arguments()
    volumes = Volumes(arguments)
    frequencies = [int(word) for word in arguments.frequencies.split(",")]
    edges = [int(word) for word in arguments.calibrate.split(",")]
    features, seconds = [], []
    for edge in edges:
        for frequency in frequencies:
            store = volumes.store(edge, frequency)
            features.append(volumes.features(store))
            seconds.append(volumes.measure(store)[0])
    rates = fit(features, seconds)
    print(f"{arguments.threads} threads: fixed {rates[0]:.3f} s, "
          f"{1e-9 / max(rates[1], 1e-15):.2f} GB/s decoded, "
          f"{1e-6 / max(rates[2], 1e-15):.2f} million blocks/s, "
          f"{1e-9 / max(rates[3], 1e-15):.2f} GB/s written")
    print("\nedge periods/256  measured/s predicted/s  error      peak/MiB")
    for edge in map(int, arguments.check.split(",")):
        for frequency in frequencies:
            store = volumes.store(edge, frequency)
            predicted = seconds_of(rates, volumes.features(store), 1)
            measured, peak = volumes.measure(store)
            print(f"{edge:4} {frequency:11} {measured:11.3f} {predicted:11.3f} "
                  f"{predicted / measured - 1:+7.0%} {peak / 2**20:13.0f}", flush=True)
    print("\nvolume, u8   machines    seconds  mesh       received by each")
    base = features[-len(frequencies) + 1]
    samples = float(edges[-1]) ** 3
    for name, size in (("1 GiB", 2**30), ("1 TiB", 2**40), ("32 TiB", 2**45), ("1 PiB", 2**50)):
        whole = base * (size / samples)
        whole[0] = 1
        for machines in (1, 16, 256, 4096):
            print(f"{name:12} {machines:8} {seconds_of(rates, whole, machines):10.1f}  "
                  f"{whole[3] / 1e9:8.0f} GB {traffic_of(whole, machines) / 1e6:8.2f} MB")


if __name__ == "__main__":
    main()

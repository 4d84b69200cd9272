"""Progress, interrupts, and the GIL."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import isobrick
from conftest import ball


def test_a_function_is_told_of_the_stages(tmp_path):
    calls = []
    isobrick.convert(ball(), tmp_path / "a.zarr", progress=lambda *call: calls.append(call))
    assert calls and all(isinstance(stage, str) and done >= 0 for stage, done, _ in calls)
    last = {stage: (done, total) for stage, done, total in calls}
    assert any(done == total > 0 for done, total in last.values())


def test_tqdm():
    tqdm = pytest.importorskip("tqdm").tqdm
    with open(os.devnull, "w") as null:
        bar = tqdm(file=null)
        isobrick.extract(ball(), 1, progress=bar)
        assert bar.n > 0 and bar.n == bar.total

        class Quiet(tqdm):
            bars = []

            def __init__(self, **options):
                super().__init__(file=null, **options)
                self.bars.append(self)

        isobrick.extract(ball(), 1, progress=Quiet)
        assert Quiet.bars and all(bar.n == bar.total for bar in Quiet.bars)


class SlowArray:
    """Takes long to read, block by block."""

    shape = (300, 300, 300)
    dtype = np.dtype("float32")

    def __init__(self, seconds=0.2):
        self.seconds = seconds
        self.reads = 0

    def __getitem__(self, box):
        self.reads += 1
        time.sleep(self.seconds)
        return np.zeros([s.stop - s.start for s in box], self.dtype)


def test_what_the_function_raises_ends_the_work():
    def fail(stage, done, total):
        raise LookupError("enough")

    array = SlowArray()
    with pytest.raises(LookupError, match="enough"):
        isobrick.extract(array, 1, progress=fail)
    assert array.reads < 6


def test_what_reading_raises_ends_the_work():
    class Broken(SlowArray):
        def __getitem__(self, box):
            if self.reads == 2:
                raise OSError("the disk is gone")
            return super().__getitem__(box)

    with pytest.raises(OSError, match="the disk is gone"):
        isobrick.extract(Broken(0.01), 1)

    class Wrong(SlowArray):
        def __getitem__(self, box):
            return np.zeros((2, 2, 2), np.float32)

    with pytest.raises(ValueError, match="another shape"):
        isobrick.extract(Wrong(), 1)


def test_other_threads_run_meanwhile(tmp_path):
    counts = []
    ended = threading.Event()

    def count():
        while not ended.is_set():
            counts.append(1)
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    before = len(counts)
    isobrick.synth("mixing", tmp_path / "a.zarr", shape=(120, 120, 120), dtype="uint8")
    during = len(counts) - before
    ended.set()
    thread.join()
    assert during > 5


SLOW = {
    "convert": "isobrick.synth('mixing', 'a.zarr', shape=(900, 900, 900))",
    "array": "isobrick.synth('mixing', shape=(900, 900, 900))",
    "extract": """
class Slow:
    shape = (3000, 300, 300)
    dtype = numpy.dtype('float32')
    def __getitem__(self, box):
        time.sleep(0.05)
        return numpy.zeros([s.stop - s.start for s in box], self.dtype)
isobrick.extract(Slow(), 1)
""",
}


@pytest.mark.parametrize("what", SLOW)
def test_an_interrupt_ends_it_soon(what, tmp_path):
    program = f"""
import isobrick, numpy, time
print('begin', flush=True)
try:
    {SLOW[what].strip().replace(chr(10), chr(10) + '    ')}
    print('not interrupted')
except KeyboardInterrupt:
    print('interrupted', flush=True)
"""
    process = subprocess.Popen([sys.executable, "-c", program], cwd=tmp_path, text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout.readline() == "begin\n"
    time.sleep(0.7)
    process.send_signal(signal.SIGINT)
    begin = time.monotonic()
    out, err = process.communicate(timeout=60)
    seconds = time.monotonic() - begin
    assert out == "interrupted\n", err
    assert seconds < 5  # a second, and what a busy machine adds
    assert not (tmp_path / "a.zarr").exists()

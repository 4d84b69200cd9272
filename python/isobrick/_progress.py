"""What `progress=` takes, as the function that the C++ layer calls."""

from contextlib import contextmanager


class _OneBar:
    """Shows the stages one after another in a bar with the interface of tqdm."""

    def __init__(self, bar):
        self.bar = bar
        self.stage = None
        self.done = 0

    def __call__(self, stage, done, total):
        if stage != self.stage:
            self.stage, self.done = stage, 0
            self.bar.reset(total=total or None)
            self.bar.set_description(stage)
        self.bar.update(done - self.done)
        self.done = done


class _BarPerStage:
    """Opens a bar of a class such as tqdm for each stage."""

    def __init__(self, bar_class):
        self.bar_class = bar_class
        self.bar = None
        self.stage = None
        self.done = 0

    def __call__(self, stage, done, total):
        if stage != self.stage:
            self.close()
            self.stage, self.done = stage, 0
            self.bar = self.bar_class(total=total or None, desc=stage, unit="B", unit_scale=True)
        self.bar.update(done - self.done)
        self.done = done

    def close(self):
        if self.bar is not None:
            self.bar.close()


@contextmanager
def reporting(progress):
    """Gives the function that reports to `progress`, or None."""
    if isinstance(progress, type) and hasattr(progress, "update"):
        bars = _BarPerStage(progress)
        try:
            yield bars
        finally:
            bars.close()
    elif progress is None or (callable(progress) and not hasattr(progress, "update")):
        yield progress
    elif hasattr(progress, "update"):
        yield _OneBar(progress)
    else:
        raise TypeError(
            "progress must be a function of (stage, done, total), a tqdm bar or its class, "
            f"not {type(progress).__name__}"
        )

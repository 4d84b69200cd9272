"""What `progress=` takes, as the function that the C++ layer calls."""


class _Bar:
    """Shows the stages in one bar with the interface of tqdm."""

    def __init__(self, bar):
        self.bar = bar
        self.stage = None
        self.done = 0

    def __call__(self, stage, done, total):
        if stage != self.stage:
            self.stage = stage
            self.done = 0
            self.bar.reset(total=total or None)
            self.bar.set_description(stage)
        self.bar.update(done - self.done)
        self.done = done


class _Bars:
    """Opens a bar of a class such as tqdm for each stage."""

    def __init__(self, bar_class):
        self.bar_class = bar_class
        self.stage = None
        self.done = 0
        self.bar = None

    def __call__(self, stage, done, total):
        if stage != self.stage:
            self.close()
            self.stage = stage
            self.done = 0
            self.bar = self.bar_class(total=total or None, desc=stage, unit="B", unit_scale=True)
        self.bar.update(done - self.done)
        self.done = done

    def close(self):
        if self.bar is not None:
            self.bar.close()


class reporting:
    """A context whose value is the function for `progress`, or None."""

    def __init__(self, progress):
        if progress is None:
            self.function = None
        elif isinstance(progress, type) and hasattr(progress, "update"):
            self.function = _Bars(progress)
        elif hasattr(progress, "update"):
            self.function = _Bar(progress)
        elif callable(progress):
            self.function = progress
        else:
            raise TypeError(
                "progress must be a function of (stage, done, total), a tqdm bar or its class, "
                f"not {type(progress).__name__}"
            )

    def __enter__(self):
        return self.function

    def __exit__(self, *_):
        if isinstance(self.function, _Bars):
            self.function.close()

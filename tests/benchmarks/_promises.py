"""What a benchmark promises, printed as it is kept or not."""


class Promises:
    """Call it with whether a promise is kept and the promise in words; ``status`` is the exit status."""

    def __init__(self) -> None:
        self.status = 0

    def __call__(self, kept: bool, sentence: str) -> None:
        print(f"   {'kept' if kept else 'NOT KEPT'}: {sentence}")
        if not kept:
            self.status = 1

"""Progress on the standard error, with the time since the start."""

import sys
import time


class Progress:
    """Prints what is going on, from the first moment."""

    def __init__(self, quiet: bool = False):
        self.start = time.perf_counter()
        self.quiet = quiet

    def say(self, text: str) -> None:
        """Print one line."""
        if not self.quiet:
            print(f"[{self.elapsed():6.1f} s] {text}", file=sys.stderr, flush=True)

    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self.start

"""The command line: `elastax feedforward`, `elastax analyse`, `elastax info`.

Exit status 0: done, 1: a gate failed, 2: bad input, with one line that says what to
change.
"""

import sys

from ._arguments import AnalyseConfig, FeedforwardConfig, parse
from ._progress import Progress


def main(argv: list[str] | None = None) -> int:
    """Run one command and return its exit status."""
    command, config = parse(argv)
    progress = Progress(config.quiet)
    progress.say(f"elastax {command}: loading JAX ...")
    from ._runtime import configure

    configure(inline=isinstance(config, FeedforwardConfig) and config.stream)
    try:
        if isinstance(config, FeedforwardConfig):
            from ._feedforward import feedforward

            return feedforward(config, progress)
        if isinstance(config, AnalyseConfig):
            from ._analyse import analyse

            return analyse(config, progress)
        from ._info import info

        return info(config, progress)
    except ValueError as error:
        reason = " ".join(str(error).split())
        print(f"elastax {command}: {reason}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"elastax {command}: stopped, nothing written", file=sys.stderr)
        return 130

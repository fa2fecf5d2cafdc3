"""Reference results of the Modelica Association: reading, comparing, drawing."""

import argparse
import csv
import os
import pathlib
from collections.abc import Callable

import jax
import matplotlib


matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np


def folder(data: pathlib.Path | None) -> pathlib.Path:
    """Folder of the reference results: given, or below ELASTAX_DATA.

    Raises:
        ValueError: it is not there.
    """
    if data is None:
        data = pathlib.Path(os.environ.get("ELASTAX_DATA", "."))
    found = data / "modelica_reference"
    if not found.is_dir():
        raise ValueError(
            f"{found} is no folder: get MAP-LIB_ReferenceResults (branch v4.1.0) and "
            "name the parent of `modelica_reference` in ELASTAX_DATA"
        )
    return found


def load(data: pathlib.Path | None, name: str) -> dict[str, np.ndarray]:
    """Signals of a reference file by name."""
    with (folder(data) / f"{name}.csv").open(encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    values = np.array(rows, float)
    return {key: values[:, k] for k, key in enumerate(head)}


def grid(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times without the repeats at events, and for every row which of them it is."""
    unique, index = np.unique(times, return_inverse=True)
    return unique, index


def deviation(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Largest difference over the range of the reference."""
    return float(np.max(np.abs(ours - theirs)) / np.ptp(theirs))


def changes(times: np.ndarray, signals: list[np.ndarray]) -> list[tuple[float, tuple]]:
    """Times at which discrete signals change, and their values from then on."""
    found = []
    for t, values in zip(times, zip(*(signal.astype(int) for signal in signals))):
        values = tuple(int(v) for v in values)
        if not found or values != found[-1][1]:
            found.append((float(t), values))
    return found


def switching_error(ours, theirs) -> float:
    """Largest difference of the switching times [s] of equal sequences.

    Raises:
        AssertionError: the sequences differ.
    """
    assert [v for _, v in ours] == [v for _, v in theirs], (ours, theirs)
    return max(abs(a - b) for (a, _), (b, _) in zip(ours, theirs))


def steps(events, end: float) -> tuple[list[float], list[list[int]]]:
    """Corners of the discrete signals for a drawing."""
    times = [t for t, _ in events] + [end]
    values = [list(v) for _, v in events] + [list(events[-1][1])]
    return times, values


def draw(path: pathlib.Path, title: str, panels, times, end: float) -> None:
    """Signals side by side, the reference left and ours right.

    Args:
        path: of the PNG.
        title: of the figure.
        panels: (label with unit, {signal: (theirs, ours)}) for continuous signals over
            `times`; with values that are lists of events for discrete ones.
        times: of the continuous signals [s].
        end: of the motion [s].
    """
    figure, axes = plt.subplots(
        len(panels), 2, sharex=True, sharey="row", figsize=(11, 2.2 * len(panels) + 1)
    )
    for row, (label, signals) in zip(axes, panels):
        for name, both in signals.items():
            for axis, signal in zip(row, both):
                if isinstance(signal, list):
                    corners, values = steps(signal, end)
                    axis.step(corners, np.array(values), where="post", label=name)
                else:
                    axis.plot(times, signal, label=name, linewidth=1)
        row[0].set_ylabel(label)
        row[1].legend(fontsize=8, loc="best")
        for axis in row:
            axis.grid(alpha=0.3)
    axes[0, 0].set_title("Modelica reference (Dymola)")
    axes[0, 1].set_title("elastax")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    figure.suptitle(title)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def command_line(main: Callable, description: str | None) -> None:
    """Run a script: `--out` for its figures, `--data` for the reference results."""
    jax.config.update("jax_enable_x64", True)
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--out", type=pathlib.Path, help="folder of the figures")
    parser.add_argument(
        "--data", type=pathlib.Path, help="folder that holds `modelica_reference`"
    )
    given = parser.parse_args()
    main(given.out, given.data)

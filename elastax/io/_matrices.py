"""Finite-element models from matrices in files."""

import pathlib

import numpy as np
import scipy.io

from ..structure import FiniteElementModel


def load_matrices(
    mass: str | pathlib.Path,
    stiffness: str | pathlib.Path,
    nodes: str | pathlib.Path,
) -> FiniteElementModel:
    """Model from Matrix Market files and a table of nodes.

    Args:
        mass, stiffness: Matrix Market files, 3 or 6 freedoms per node, node by node.
        nodes: text with a row for each node: label, x, y, z [m], separated by blanks or
            commas; lines that begin with `#` are left out.

    Raises:
        ValueError: a file cannot be read, or the model is refused.
    """
    matrices = []
    for path in (mass, stiffness):
        try:
            matrices.append(scipy.io.mmread(str(path)))
        except (OSError, ValueError) as error:
            raise ValueError(f"{path}: no Matrix Market file: {error}") from None
    try:
        lines = pathlib.Path(nodes).read_text().splitlines()
    except OSError as error:
        raise ValueError(f"{nodes}: cannot be read: {error.strerror}") from None
    labels, positions = [], []
    for number, line in enumerate(lines, start=1):
        parts = line.replace(",", " ").split()
        if not parts or parts[0].startswith("#"):
            continue
        try:
            label, place = parts[0], [float(x) for x in parts[1:]]
        except ValueError:
            raise ValueError(
                f"{nodes}, line {number}: `{line}` has no numbers"
            ) from None
        if len(place) != 3:
            raise ValueError(
                f"{nodes}, line {number}: a label and x, y, z are needed, not `{line}`"
            )
        labels.append(label)
        positions.append(place)
    return FiniteElementModel(
        np.array(positions), matrices[0], matrices[1], tuple(labels)
    )

"""How generators of SID_FEM files lay out columns, indices and symmetric matrices."""

import abc

import equinox as eqx
import numpy as np


class AbstractColumnLayout(eqx.Module):
    """Which column of `Gr` and `Ge` belongs to a mode and an axis."""

    @property
    @abc.abstractmethod
    def name(self) -> str:
        """In words, for reports."""

    @abc.abstractmethod
    def unpack(self, matrix: np.ndarray) -> np.ndarray:
        """From shape (rows, 3 modes) to (rows, modes, 3)."""

    @abc.abstractmethod
    def pack(self, array: np.ndarray) -> np.ndarray:
        """From shape (rows, modes, 3) to (rows, 3 modes)."""


class AxisMajor(AbstractColumnLayout):
    """All modes of the first axis, then of the second: column (a - 1) modes + l."""

    @property
    def name(self) -> str:
        return "axis-major"

    def unpack(self, matrix: np.ndarray) -> np.ndarray:
        return np.swapaxes(matrix.reshape(matrix.shape[0], 3, -1), 1, 2)

    def pack(self, array: np.ndarray) -> np.ndarray:
        return np.swapaxes(array, 1, 2).reshape(array.shape[0], -1)


class ModeMajor(AbstractColumnLayout):
    """The axes of the first mode, then of the second: column 3 (l - 1) + a."""

    @property
    def name(self) -> str:
        return "mode-major"

    def unpack(self, matrix: np.ndarray) -> np.ndarray:
        return matrix.reshape(matrix.shape[0], -1, 3)

    def pack(self, array: np.ndarray) -> np.ndarray:
        return array.reshape(array.shape[0], -1)


class AbstractIndexOrder(eqx.Module):
    """Order of the three indices of `m1`."""

    @property
    @abc.abstractmethod
    def name(self) -> str:
        """In words, for reports."""

    @abc.abstractmethod
    def arrange(self, indices: tuple[int, ...]) -> tuple[int, ...]:
        """From the file's indices to row, mode, column, and back."""


class RowModeColumn(AbstractIndexOrder):
    """`m1(row, mode, column)`."""

    @property
    def name(self) -> str:
        return "row, mode, column"

    def arrange(self, indices: tuple[int, ...]) -> tuple[int, ...]:
        return indices


class RowColumnMode(AbstractIndexOrder):
    """`m1(row, column, mode)`."""

    @property
    def name(self) -> str:
        return "row, column, mode"

    def arrange(self, indices: tuple[int, ...]) -> tuple[int, ...]:
        return indices[0], indices[2], indices[1]


class AbstractStorage(eqx.Module):
    """Which `structure` a matrix is written with, and which of its elements."""

    @abc.abstractmethod
    def structure(self, matrix: np.ndarray, symmetric: bool, constant: bool) -> int:
        """Number of the structure.

        Args:
            matrix: $M_0$.
            symmetric: whether it always is.
            constant: whether the series ends with it.
        """


class TriangularStorage(AbstractStorage):
    """Symmetric matrices by their lower triangle; zero blocks without records."""

    def structure(self, matrix: np.ndarray, symmetric: bool, constant: bool) -> int:
        if symmetric:
            return 2
        return 3 if matrix.any() or not constant else 0


class SpecialStorage(AbstractStorage):
    """Zero, unit and diagonal matrices as such, all others in full."""

    def structure(self, matrix: np.ndarray, symmetric: bool, constant: bool) -> int:
        if not constant:
            return 3
        if not matrix.any():
            return 0
        if matrix.shape[0] == matrix.shape[1]:
            if np.array_equal(matrix, np.eye(len(matrix))):
                return 4
            if np.array_equal(matrix, np.diag(np.diag(matrix))):
                return 1
        return 3


AXIS_MAJOR = AxisMajor()
MODE_MAJOR = ModeMajor()
COLUMN_LAYOUTS = (AXIS_MAJOR, MODE_MAJOR)
ROW_MODE_COLUMN = RowModeColumn()
ROW_COLUMN_MODE = RowColumnMode()
INDEX_ORDERS = (ROW_MODE_COLUMN, ROW_COLUMN_MODE)

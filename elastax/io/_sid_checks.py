"""What SID data must obey, and what a reader should look at."""

import numpy as np

from ._sid_data import SidData, skew_matrices, squares_of_tensor


def identities(data: SidData) -> dict[str, float | None]:
    """Residual of every identity over the largest element of its block.

    Where geometric stiffening gives Cr.m1 a symmetric part, Ge may have it or not.
    """

    def residual(left, right):
        size = max(np.abs(left).max(initial=0.0), np.abs(right).max(initial=0.0))
        return None if size == 0 else float(np.abs(left - right).max() / size)

    found = {
        "mdCM.m1 = Ct": residual(data.mdCM_1, data.Ct_0),
        "J.m1 = sym(Gr)": residual(
            data.J_1, 0.5 * (data.Gr + np.swapaxes(data.Gr, 1, 2))
        ),
        "Ge = 2 Cr.m1": residual(
            data.Ge, data.Ge - gyroscopic_residual(data.Ge, data.Cr_1)
        ),
        "Oe = -dJ/2": residual(data.Oe_0, -0.5 * squares_of_tensor(data.J_1)),
    }
    for key, pairs in {
        "origin.m1 = phi": [(node.origin_1, node.phi) for node in data.nodes],
        "AP.m1 = skew(psi)": [
            (node.rotation_1, np.swapaxes(skew_matrices(node.psi.T), 0, 1))
            for node in data.nodes
        ],
    }.items():
        left = np.array([pair[0] for pair in pairs])
        right = np.array([pair[1] for pair in pairs])
        found[key] = residual(left, right)
    return found


def gyroscopic_residual(Ge: np.ndarray, Cr_1: np.ndarray) -> np.ndarray:
    """What is left of Ge without twice Cr.m1, or twice its antisymmetric part."""
    whole, skewed = Ge - 2.0 * Cr_1, Ge - (Cr_1 - np.swapaxes(Cr_1, 0, 1))
    largest = lambda x: np.abs(x).max(initial=0.0)
    return whole if largest(whole) <= largest(skewed) else skewed


def is_stiffened(data: SidData) -> bool:
    """Whether couplings grow otherwise than by the displacement of first order."""
    symmetric = np.abs(data.Cr_1 + np.swapaxes(data.Cr_1, 0, 1)).max(initial=0.0)
    return bool(data.Ct_1.any() or symmetric > 1e-6 * np.abs(data.Me).max(initial=0.0))


def notes_on(data: SidData):
    """What a reader should look at."""
    radius = np.sqrt(max(np.trace(data.J_0), 0.0) / (2.0 * data.mass))
    places = [np.abs(node.position).max() for node in data.nodes]
    size = max([radius, *places])
    if size > 30.0:
        yield (
            f"the body is {size:.4g} units of length large: millimetres are suspected; "
            "`scaled(1e-3)` gives metres if the mass is in kg"
        )
    elif size < 1e-3:
        yield f"the body is only {size:.4g} units of length large: check the units"
    for key in ("Oe_1", "Ct_1"):
        array = getattr(data, key)
        largest = np.abs(array).max(initial=0.0)
        if largest:
            skewed = np.abs(array - np.swapaxes(array, 0, 1)).max() / largest
            if skewed > 1e-9:
                yield (
                    f"{key[:2]}.m1 is not symmetric in the modes by {skewed:.1e} of "
                    "its largest element: a modal body takes its symmetric part"
                )
    Ke, De = np.diag(data.Ke), np.diag(data.De)
    Me = np.diag(data.Me)
    if np.any(De > 0) and np.all(Ke >= 0):
        critical = 2.0 * np.sqrt(np.where(Ke > 0, Ke * Me, 1.0))
        ratio = (De / critical).max()
        if ratio > 1.0 or ratio < 1e-6:
            yield (
                f"the largest damping ratio would be {ratio:.2g}: De may hold "
                "something else than damping; set it with `with_damping_ratio`"
            )
    both = data.Ge + np.swapaxes(data.Ge, 0, 1)
    if is_stiffened(data) and np.abs(both).max() > 1e-6 * np.abs(data.Ge).max():
        yield (
            "Ge holds twice the symmetric part of Cr.m1, which no energy has: a modal "
            "body takes what its kinetic energy gives"
        )
    if data.ksigma.any():
        yield "ksigma is not zero: prestress is not part of a modal body"

"""Bodies whose SID files the tests write."""

import functools

import jax.numpy as jnp
import numpy as np
from elastax.structure import BodyNodes, ModalBody, point_mass_body


@functools.cache
def random_body(modes: int = 3, curved: bool = True, names=("7", "12")) -> ModalBody:
    """Six points of mass of no particular kind, two of them nodes.

    Args:
        modes: how many.
        curved: whether their displacement is of second order.
        names: of the nodes.
    """
    generator = np.random.default_rng(11 + modes)
    draw = generator.standard_normal
    masses = generator.uniform(0.5, 2.0, 6)
    places, shapes, turns = draw((6, 3)), draw((6, 3, modes)), draw((6, 3, modes))
    bent = draw((6, 3, modes, modes))
    bent = bent + np.swapaxes(bent, 2, 3)
    stiffness = draw((modes, modes))
    stiffness = stiffness @ stiffness.T + 100.0 * np.eye(modes)
    nodes = BodyNodes(
        places[:2],
        shapes[:2],
        turns[:2],
        bent[:2] if curved else np.zeros_like(bent[:2]),
        tuple(names),
    )
    return point_mass_body(
        jnp.asarray(masses),
        jnp.asarray(places),
        jnp.asarray(shapes),
        jnp.asarray(stiffness),
        damping=jnp.asarray(1e-3 * stiffness),
        curvatures=jnp.asarray(bent) if curved else None,
        nodes=nodes,
        mode_names=tuple(f"shape {k}" for k in range(modes)),
        name="six points",
    )

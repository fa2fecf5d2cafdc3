"""The two-link example of [Reiner2010], figure 3.8, from the printed equations."""

import jax.numpy as jnp
from elastax.analysis import ControlSystem, SignalNames


NAMES = SignalNames(
    ("phi_a", "phi_a'", "phi_e", "phi_e'"), ("tau_a",), ("y of the tip",)
)


def two_link(l=2.0, xi=0.2, m=100.0, c=1e6, d=150.0, Jz=10.0, x_l=0.5) -> ControlSystem:
    """Equations (3.36) and output (3.37)."""

    def blocks(x):
        _, w, phi, v = x
        co, si, ml2 = jnp.cos(phi), jnp.sin(phi), m * l**2
        M_11 = ml2 * (1 - 2 * xi**2 * co + 2 * xi * co - 2 * xi + 2 * xi**2) + Jz
        M_21 = Jz + ml2 * (1 - 2 * xi + xi * co - xi**2 * co + xi**2)
        M_22 = Jz + ml2 * (1 - xi) ** 2
        h_1 = ml2 * (xi**2 - xi) * (v**2 + 2 * w * v) * si
        h_2 = c * phi + d * v + ml2 * (xi - xi**2) * w**2 * si
        return jnp.array([[M_11, M_21], [M_21, M_22]]), jnp.array([h_1, h_2])

    def rate(x, u):
        mass, h = blocks(x)
        force = jnp.concatenate([u, jnp.zeros(1)]) - h
        a = jnp.linalg.solve(mass, force)
        return jnp.array([x[1], a[0], x[3], a[1]])

    def output(x):
        reach = x_l + l * (1 - xi)
        return jnp.array([reach * jnp.sin(x[0] + x[2]) + l * xi * jnp.sin(x[0])])

    system = ControlSystem(rate, output, NAMES)
    return system

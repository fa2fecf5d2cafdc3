"""Systems with zero dynamics that are known from the literature.

Every entry: the system, its equilibrium, the relative degrees, the eigenvalues of the
zero dynamics, and the verdict.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from elastax.analysis import ControlSystem, SignalNames, find_equilibrium


class Case(NamedTuple):
    system: ControlSystem
    x: np.ndarray
    degrees: tuple[int, ...]
    eigenvalues: list
    verdict: str
    source: str
    rtol: float = 1e-8


def siso(drift, field, output, states: int) -> ControlSystem:
    names = SignalNames.numbered(states, 1, 1)
    return ControlSystem.affine(
        drift, lambda x: field(x)[:, None], lambda x: output(x)[None], names
    )


def linear(A, B, C) -> ControlSystem:
    A, B, C = (jnp.asarray(x, float) for x in (A, B, C))
    names = SignalNames.numbered(len(A), B.shape[1], len(C))
    return ControlSystem(lambda x, u: A @ x + B @ u, lambda x: C @ x, names)


def van_der_pol(output):
    return siso(
        lambda x: jnp.array([x[1], -x[0] + 0.7 * (1.0 - x[0] ** 2) * x[1]]),
        lambda x: jnp.array([0.0, 1.0]),
        output,
        2,
    )


def khalil_three_states():
    return siso(
        lambda x: jnp.array([-x[0], x[2], x[0] * x[2]]),
        lambda x: jnp.array([(2.0 + x[2] ** 2) / (1.0 + x[2] ** 2), 0.0, 1.0]),
        lambda x: x[1],
        3,
    )


def slotine_cubic(sign: float):
    return siso(
        lambda x: jnp.array([x[1] ** 3, 0.0]),
        lambda x: jnp.array([1.0, sign]),
        lambda x: x[0],
        2,
    )


def cart_pendulum(of_pendulum: bool, mass=0.3, cart=1.2, length=0.5, gravity=9.81):
    """Point mass on a light rod, upright; angle from the top, force on the cart."""

    def rate(x, u):
        angle, speed = x[1], x[3]
        s, c = jnp.sin(angle), jnp.cos(angle)
        lever = cart + mass * s**2
        push = u[0] + mass * s * (length * speed**2 - gravity * c)
        ahead = push / lever
        turn = (gravity * s - c * ahead) / length
        return jnp.array([x[2], speed, ahead, turn])

    which = 1 if of_pendulum else 0
    return ControlSystem(
        rate, lambda x: x[which : which + 1], SignalNames.numbered(4, 1, 1)
    )


def planar_vtol(epsilon: float):
    def rate(x, u):
        s, c = jnp.sin(x[2]), jnp.cos(x[2])
        return jnp.array(
            [
                x[3],
                x[4],
                x[5],
                -s * u[0] + epsilon * c * u[1],
                c * u[0] + epsilon * s * u[1] - 1.0,
                u[1],
            ]
        )

    return ControlSystem(rate, lambda x: x[:2], SignalNames.numbered(6, 2, 2))


def quadruple_tank(gamma, pump, volts):
    """Two pumps, four tanks [cm, s, V]; levels of the lower tanks as outputs."""
    area = jnp.array([28.0, 32.0, 28.0, 32.0])
    hole = jnp.array([0.071, 0.057, 0.071, 0.057])
    g, (k1, k2), (g1, g2) = 981.0, pump, gamma

    def rate(x, u):
        out = hole * jnp.sqrt(2.0 * g * x)
        flow = jnp.array(
            [
                -out[0] + out[2] + g1 * k1 * u[0],
                -out[1] + out[3] + g2 * k2 * u[1],
                -out[2] + (1.0 - g2) * k2 * u[1],
                -out[3] + (1.0 - g1) * k1 * u[0],
            ]
        )
        return flow / area

    system = ControlSystem(rate, lambda x: 0.5 * x[:2], SignalNames.numbered(4, 2, 2))
    x, _ = find_equilibrium(
        system, jnp.array([12.0, 13.0, 3.0, 3.0]), jnp.full(2, volts)
    )
    return system, np.asarray(x)


def flexible_joint(of_link: bool):
    """Rotor and link on a spring in a horizontal plane, without damping."""
    k, rotor, link = 100.0, 0.2, 1.5
    which = 0 if of_link else 2

    def rate(x, u):
        torque = k * (x[2] - x[0])
        return jnp.array([x[1], torque / link, x[3], (u[0] - torque) / rotor])

    return ControlSystem(
        rate, lambda x: x[which : which + 1], SignalNames.numbered(4, 1, 1)
    )


def van_de_vusse():
    """Isothermal stirred tank A -> B -> C, 2 A -> D; dilution rate to B [1/min]."""
    k1, k2, k3, feed = 5.0 / 6.0, 5.0 / 3.0, 1.0 / 6.0, 10.0

    def rate(x, u):
        a, b = x
        return jnp.array(
            [u[0] * (feed - a) - k1 * a - k3 * a**2, -u[0] * b + k1 * a - k2 * b]
        )

    b = (k1 * 3.0) / (4.0 / 7.0 + k2)
    system = ControlSystem(rate, lambda x: x[1:], SignalNames.numbered(2, 1, 1))
    return system, np.array([3.0, b])


def boost_converter(of_voltage: bool):
    """Averaged: current and voltage over the off-time d' of the switch."""
    L, C, R, source, off = 1e-3, 1e-4, 20.0, 12.0, 0.6

    def rate(x, u):
        current, voltage = x
        return jnp.array(
            [(source - u[0] * voltage) / L, (u[0] * current - voltage / R) / C]
        )

    voltage = source / off
    current = voltage / (R * off)
    zero = R * off**2 / L if of_voltage else None
    which = 1 if of_voltage else 0
    system = ControlSystem(
        rate, lambda x: x[which : which + 1], SignalNames.numbered(2, 1, 1)
    )
    if zero is None:  # C v v' = v i - v^2 / R with i held: v = source i R / v
        zero = -2.0 / (R * C)
    return system, np.array([current, voltage]), zero


def skogestad_two_by_two():
    """1/((0.2 s + 1)(s + 1)) [[1, 1], [1 + 2 s, 2]] in controllable states."""
    block = np.array([[0.0, 1.0], [-5.0, -6.0]])
    A = np.kron(np.eye(2), block)
    B = np.zeros((4, 2))
    B[1, 0] = B[3, 1] = 5.0
    C = np.array([[1.0, 0.0, 1.0, 0.0], [1.0, 2.0, 2.0, 0.0]])
    return linear(A, B, C)


def cases() -> dict[str, Case]:
    zero4, zero2 = np.zeros(4), np.zeros(2)
    minimum = quadruple_tank((0.70, 0.60), (3.33, 3.35), 3.00)
    beyond = quadruple_tank((0.43, 0.34), (3.14, 3.29), 3.15)
    reactor = van_de_vusse()
    voltage, current = boost_converter(True), boost_converter(False)
    root = np.sqrt(9.81 / 0.5)
    return {
        "van der Pol, position": Case(
            van_der_pol(lambda x: x[0]),
            zero2,
            (2,),
            [],
            "none",
            "[Khalil2002] section 13.2",
        ),
        "van der Pol, speed": Case(
            van_der_pol(lambda x: x[1]),
            zero2,
            (1,),
            [0.0],
            "open",
            "[Khalil2002] section 13.2",
        ),
        "three states": Case(
            khalil_three_states(),
            np.zeros(3),
            (2,),
            [-1.0],
            "stable",
            "[Khalil2002] section 13.2",
        ),
        "linear, minimum phase": Case(
            linear([[0, 1], [0, 0]], [[1], [1]], [[1, 0]]),
            zero2,
            (1,),
            [-1.0],
            "stable",
            "[SlotineLi1991] 6.1.3",
        ),
        "linear, not minimum phase": Case(
            linear([[0, 1], [0, 0]], [[1], [-1]], [[1, 0]]),
            zero2,
            (1,),
            [1.0],
            "unstable",
            "[SlotineLi1991] 6.1.3",
        ),
        "cubic": Case(
            slotine_cubic(1.0), zero2, (1,), [0.0], "open", "[SlotineLi1991] 6.1.3"
        ),
        "pendulum on a cart, cart": Case(
            cart_pendulum(False),
            zero4,
            (2,),
            [-root, root],
            "unstable",
            "closed form: theta'' = g/l sin theta",
        ),
        "pendulum on a cart, angle": Case(
            cart_pendulum(True), zero4, (2,), [0.0, 0.0], "open", "closed form: x'' = 0"
        ),
        "planar VTOL": Case(
            planar_vtol(0.25),
            np.zeros(6),
            (2, 2),
            [-2.0, 2.0],
            "unstable",
            "[Hauser1992] epsilon theta'' = sin theta",
        ),
        "quadruple tank, minimum phase": Case(
            minimum[0],
            minimum[1],
            (1, 1),
            [-0.060, -0.018],
            "stable",
            "[Johansson2000]",
            0.035,  # two digits, from rounded constants
        ),
        "quadruple tank, not minimum phase": Case(
            beyond[0],
            beyond[1],
            (1, 1),
            [-0.057, 0.013],
            "unstable",
            "[Johansson2000]",
            0.02,  # printed digits
        ),
        "flexible joint, link": Case(
            flexible_joint(True), zero4, (4,), [], "none", "[Spong1987]"
        ),
        "flexible joint, motor": Case(
            flexible_joint(False),
            zero4,
            (2,),
            [-1j * np.sqrt(100 / 1.5), 1j * np.sqrt(100 / 1.5)],
            "open",
            "closed form: the link on a fixed rotor",
        ),
        "van de Vusse reactor": Case(
            reactor[0],
            reactor[1],
            (1,),
            [3.1472 / 1.117],
            "unstable",
            "[Bequette2003]",
            1e-3,  # printed digits
        ),
        "boost converter, voltage": Case(
            voltage[0],
            voltage[1],
            (1,),
            [voltage[2]],
            "unstable",
            "[Erickson2001] D'^2 R / L",
        ),
        "boost converter, current": Case(
            current[0], current[1], (1,), [current[2]], "stable", "closed form"
        ),
        "two by two, zero at 0.5": Case(
            skogestad_two_by_two(),
            zero4,
            (2, 1),
            [0.5],
            "unstable",
            "[Skogestad2005]",
        ),
    }

"""Do modal bodies bend and swing as another program's beams do?

`python -m benchmarks.flexible_arm`; needs `exudyn` (extra `bench`), and is not a part
of `make bench`. Exudyn's planar beam of absolute nodal coordinates, which is
geometrically exact, against a modal beam on a joint: eigenfrequencies clamped and
pinned, and the swing of a pendulum from the horizontal. Writes `flexible_arm.json` and
`FLEXIBLE_ARM.md`, exit status 1 if one of them is off by more than 1 %.
"""

import argparse
import json
import pathlib
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.dynamics import ElasticRobot, equations_of_motion, forward_dynamics
from elastax.kinematics import forward_kinematics
from elastax.robots import beam_on_joint
from elastax.structure import (
    BeamSection,
    ClampedFree,
    Material,
    ModeCounts,
    UniformBeam,
    modal_beam,
)

from ._machine import header


# an aluminium strip, 40 x 4 mm, that bends over its thin side
AREA, SECOND = 1.6e-4, 0.04 * 0.004**3 / 12.0  # m^2, m^4
BEAM = UniformBeam(
    Material(young=7e10, shear=2.6e10, density=2700.0),
    BeamSection(AREA, SECOND, SECOND, 4.0 * SECOND),
    1.0,
)
GRAVITY = -9.81  # m/s^2, along y
DURATION, STEP, KEPT = 1.5, 1e-4, 30  # s, s, every so many steps
MODES = 5


def pendulum() -> ElasticRobot:
    """The strip on a joint without torque."""
    return beam_on_joint(
        MODES,
        tip_mass=0.0,
        beam=BEAM,
        support=ClampedFree(),
        gravity=(0.0, GRAVITY, 0.0),
    )


def frequencies(robot: ElasticRobot) -> np.ndarray:
    """Of the pendulum without weight, the joint free [Hz]."""
    n, m = robot.axes, robot.elastic
    zero, rest = jnp.zeros(n), jnp.zeros(m)
    still = eqx.tree_at(lambda r: r.gravity, robot, jnp.zeros(3))
    blocks = equations_of_motion(still, zero, rest, zero, zero, rest, zero)
    mass = np.block(
        [
            [np.asarray(blocks.M_aa), np.asarray(blocks.M_ae)],
            [np.asarray(blocks.M_ae).T, np.asarray(blocks.M_ee)],
        ]
    )
    stiffness = np.zeros_like(mass)
    body = robot.modal_links[0].body
    stiffness[n:, n:] = np.asarray(body.K_e)
    squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real
    return np.sqrt(np.maximum(np.sort(squares), 0.0)) / (2 * np.pi)


@jax.jit
def swing(robot: ElasticRobot):
    """Times, tip and rigid tip positions in the plane, shape (times, 2) each."""
    n = robot.axes
    zero, rest = jnp.zeros(n), jnp.zeros(robot.elastic)

    def rates(x):
        q, eta, qd, etad = x
        qdd, etadd, _ = forward_dynamics(robot, q, eta, q, qd, etad, qd, zero)
        return qd, etad, qdd, etadd

    def step(x, _):
        plus = lambda k, f: jax.tree.map(lambda a, b: a + f * b, x, k)
        k1 = rates(x)
        k2 = rates(plus(k1, 0.5 * STEP))
        k3 = rates(plus(k2, 0.5 * STEP))
        k4 = rates(plus(k3, STEP))
        mean = jax.tree.map(
            lambda a, b, c, d: (a + 2.0 * b + 2.0 * c + d) / 6.0, k1, k2, k3, k4
        )
        return plus(mean, STEP), None

    def tip(q, eta):
        # to second order: the chain's own joints leave the shortening out
        pose = forward_kinematics(robot.chain, robot.joint_coordinates(q, 0.0 * eta))
        body = robot.modal_links[0].body
        moved = body.nodes.displacement(body.nodes.index("tip"), eta)
        return (pose[:3, 3] + pose[:3, :3] @ moved)[:2], pose[:2, 3]

    def block(x, _):
        new, _ = jax.lax.scan(step, x, None, length=KEPT)
        return new, tip(x[0], x[1])

    count = round(DURATION / (STEP * KEPT))
    _, (bent, rigid) = jax.lax.scan(block, (zero, rest, zero, rest), None, length=count)
    return STEP * KEPT * jnp.arange(count), bent, rigid


def compare() -> list[dict]:
    """Rows of name, ours, theirs and relative difference."""
    from .peers.exudyn import CLAMPED, PINNED, PlanarBeam

    line = 2700.0 * AREA
    peer = lambda base, gravity=0.0: PlanarBeam(
        1.0, line, 7e10 * SECOND, 7e10 * AREA, 24, base, gravity
    )
    rows = []

    def row(name, ours, theirs, difference):
        rows.append(
            {
                "name": name,
                "ours": float(ours),
                "theirs": float(theirs),
                "difference": float(difference),
            }
        )

    clamped = eqx.filter_jit(lambda beam: modal_beam(beam, ModeCounts(3)))(BEAM)
    for k, (ours, theirs) in enumerate(
        zip(np.asarray(clamped.frequencies()), peer(CLAMPED).frequencies(3))
    ):
        row(f"clamped, mode {k + 1} [Hz]", ours, theirs, abs(ours / theirs - 1.0))
    robot = pendulum()
    found, expected = frequencies(robot)[1:3], peer(PINNED).frequencies(3)[1:]
    for k, (ours, theirs) in enumerate(zip(found, expected)):
        row(f"pinned, mode {k + 1} [Hz]", ours, theirs, abs(ours / theirs - 1.0))
    times, bent, rigid = map(np.asarray, swing(robot))
    clock, tip = peer(PINNED, GRAVITY).swing(DURATION, 15000)
    theirs = np.stack([np.interp(times, clock, tip[:, a]) for a in range(2)], axis=1)
    off = np.linalg.norm(bent - theirs, axis=1)
    size = np.ptp(theirs, axis=0).max()
    row("swing, tip, largest difference [m]", off.max(), size, off.max() / size)
    deflection = np.linalg.norm(bent - rigid, axis=1).max()
    row("swing, largest deflection [m]", deflection, np.nan, 0.0)
    return rows


def markdown(header: dict, rows: list[dict]) -> str:
    """The table and what stands above it."""
    found = header["versions"]
    lines = [
        "# A flexible arm against Exudyn",
        "",
        f"{header['date']}, {header['machine']['cpu']}, jax {found['jax']}, Exudyn "
        f"{header['exudyn']}, float64. Aluminium strip of 1 m, 40 x 4 mm; modal beam "
        f"of {MODES} clamped modes on a joint against 24 elements of absolute nodal "
        "coordinates. The swing starts at rest from the horizontal and takes "
        f"{DURATION:g} s; its difference is over the range of the tip.",
        "",
        "| | elastax | Exudyn | relative difference |",
        "|---|---|---|---|",
    ]
    for row in rows:
        theirs = "" if np.isnan(row["theirs"]) else f"{row['theirs']:.5g}"
        lines.append(
            f"| {row['name']} | {row['ours']:.5g} | {theirs} | "
            f"{row['difference']:.1e} |"
        )
    return "\n".join(lines) + "\n"


def main(argv: list[str] | None = None) -> int:
    """Compare, write, and return 1 where something is off by more than 1 %."""
    parser = argparse.ArgumentParser("benchmarks.flexible_arm")
    parser.add_argument(
        "--out", type=pathlib.Path, default=pathlib.Path(__file__).parent
    )
    options = parser.parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    import exudyn

    rows = compare()
    head = header() | {"exudyn": exudyn.__version__}
    options.out.mkdir(parents=True, exist_ok=True)
    content = json.dumps({**head, "rows": rows}, indent=1).replace("NaN", "null")
    (options.out / "flexible_arm.json").write_text(content + "\n")
    (options.out / "FLEXIBLE_ARM.md").write_text(markdown(head, rows))
    print(markdown(head, rows))
    return int(any(row["difference"] > 0.01 for row in rows))


if __name__ == "__main__":
    sys.exit(main())

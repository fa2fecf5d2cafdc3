"""The benchmarks, their cases, and the process that each case runs in."""

import ast
import dataclasses
import pathlib


FOLDER = pathlib.Path(__file__).resolve().parent


@dataclasses.dataclass(frozen=True)
class Case:
    """One process.

    Attributes:
        name: handed to the benchmark's `run`.
        threads: processors that the process may use.
        devices: host devices that JAX shows.
        limit: time after which the process is ended [s].
        inline: whether programs run in the thread that calls them.
    """

    name: str
    threads: int = 2
    devices: int = 1
    limit: float = 240.0
    inline: bool = False


def _one(*names: str) -> tuple[Case, ...]:
    """Cases on one thread."""
    return tuple(Case(name, threads=1) for name in names)


def _streamed(name: str) -> Case:
    """A case as a controller would run it: a core of its own, no hand-over."""
    return Case(name, threads=1, inline=True)


_BATCHED = Case("batched_2", devices=2)
_USES = ("single", "scan", "vmap", "jvp", "jacfwd", "vjp")
_KERNELS = ("pose", "jacobian", "inverse_dynamics", "multibody", "forward_dynamics")

SUITE: dict[str, tuple[Case, ...]] = {
    "rigid_inverse_dynamics": (
        _BATCHED,
        *_one("batched_1", "scan"),
        Case("single"),
        Case("mujoco", devices=2),
    ),
    "elastic_forward_dynamics": (
        _BATCHED,
        *_one("batched_1", "scan"),
        Case("default_robot_batched_2", devices=2),
        *_one("default_robot_scan"),
    ),
    "kernels": tuple(
        Case(f"{kernel}_{use}", threads=2 if use == "single" else 1)
        for kernel in _KERNELS
        for use in _USES
    ),
    "asim": (
        Case("asim_offline"),
        _streamed("asim_step"),
        Case("asim_jvp"),
        Case("asim_vjp"),
        _streamed("rigid_step"),
        _streamed("flexible_joint_step"),
    ),
    "simulation": (Case("one"), Case("vmap"), Case("devices", devices=2)),
    "gradients": (Case("reverse"), Case("forward"), Case("forward_18", limit=480.0)),
    "simulation_peer": (Case("motion"),),
    "growth": (
        Case("samples"),
        Case("cases", limit=480.0),
        Case("cases_asim"),
        *_one("axes", "elastic"),
    ),
    "inverse_kinematics": (
        *_one("kr210", "ur10e", "iiwa14"),
        Case("kr210_2", devices=2),
    ),
    "urdf_kinematics": _one("kr210", "ur10e", "iiwa14"),
    "main_job": (Case("both"),),
}


def select(names: list[str]) -> dict[str, tuple[Case, ...]]:
    """The benchmarks that were named, all of them if none was.

    Raises:
        ValueError: there is no benchmark of that name.
    """
    for name in names:
        if name not in SUITE:
            raise ValueError(
                f"a benchmark must be one of {', '.join(SUITE)}, but is `{name}`"
            )
    return {name: cases for name, cases in SUITE.items() if not names or name in names}


def description(name: str) -> tuple[str, str]:
    """Question of a benchmark, and what its module says about the measurement."""
    text = (FOLDER / f"{name}.py").read_text(encoding="utf-8")
    question, _, rest = (ast.get_docstring(ast.parse(text)) or "").partition("\n")
    return question, " ".join(rest.split())

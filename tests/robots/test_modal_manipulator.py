"""The manipulator of figure 3.19: statics, SID round trip, ASIM under motor control."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.analysis import locked_frequencies
from elastax.control import CascadeMotorControl
from elastax.dynamics import static_equilibrium
from elastax.inverse import ASIM, FlexibleJointInverse
from elastax.io import load_sid, save_sid
from elastax.kinematics import forward_kinematics
from elastax.robots import ladder_link, modal_manipulator

from tests.helpers import assert_close
from tests.runs import run
from tests.systems import smooth_reference


@pytest.fixture(scope="module")
def robot():
    return modal_manipulator()


@pytest.fixture(scope="module")
def frequencies():
    return jax.jit(locked_frequencies)


@pytest.mark.slow
def test_coordinates(robot, frequencies):
    """Ten modes of the link, three of the beam; soft enough to be seen."""
    assert (robot.axes, robot.elastic) == (3, 13)
    hertz = np.asarray(frequencies(robot, jnp.zeros(3)))
    assert hertz.shape == (16,)
    assert 2.0 < hertz[0] < 12.0


@pytest.mark.slow
def test_sag_against_the_frame_of_elements(robot):
    """Stretched and at rest, the tool sinks as the finite elements under the load do.

    The link alone: its full finite-element model, clamped at the base, under the weight
    and the moment of all that follows, its own weight included.
    """
    stiff = dataclasses.replace(
        robot, drives=eqx.tree_at(_gear, robot.drives, replace_fn=lambda k: 1e6 * k)
    )
    model = ladder_link()
    link, beam = robot.modal_links
    q, eta = static_equilibrium(stiff, jnp.zeros(3))
    modes = np.asarray(eta)[link.first : link.first + link.body.modes]
    tip = link.body.nodes.index("tip")
    sunk = np.asarray(link.body.nodes.phi)[tip] @ modes
    motor_and_hub = 11.0
    weight = 9.81 * (float(beam.body.mass) + motor_and_hub)
    # stretched, up to the change of slope: first moment of the beam about its clamp
    moment = 9.81 * float(beam.body.first_moment[0])
    count = len(model.positions)
    load = np.zeros((count, 6))
    load[:, 1] = (
        -9.81
        * np.asarray(model.mass @ model.rigid_motions()[:, 1]).reshape(count, 6)[:, 1]
    )
    load[model.index("tip"), 1] -= weight
    load[model.index("tip"), 5] -= moment
    free = np.setdiff1d(np.arange(6 * count), model.of_node(model.index("base")))
    moved = np.zeros(6 * count)
    stiffness = model.stiffness[free][:, free].toarray()
    moved[free] = np.linalg.solve(stiffness, load.ravel()[free])
    expected = moved.reshape(count, 6)[model.index("tip"), 1]
    # ten eigenmodes of the clamped link carry a load at its end to three per cent
    assert_close(sunk[1], expected, rtol=0.03)
    assert abs(float(q[0])) < 1e-12


def _gear(drives):
    return drives.stiffness.linear


@pytest.mark.slow
def test_sid_file_in_place_of_the_elements(robot, tmp_path):
    path = tmp_path / "link.SID_FEM"
    # whole numbers are the only names that SID files keep
    save_sid(path, robot.modal_links[0].body)
    body = load_sid(path).modal_body()
    labels = list(body.nodes.names)
    source = robot.modal_links[0].body.nodes.names
    for name in ("base", "tip"):
        labels[source.index(name)] = name
    nodes = dataclasses.replace(body.nodes, names=tuple(labels))
    twin = modal_manipulator(link=dataclasses.replace(body, nodes=nodes))
    q, eta = jnp.array([0.2, 0.3, -0.5]), 1e-3 * jnp.ones(13)
    place = lambda r: forward_kinematics(r.chain, r.joint_coordinates(q, eta))
    # twelve digits in the file
    assert_close(place(twin), place(robot), rtol=1e-9, atol=1e-11)


@pytest.mark.slow
def test_refuses_another_length(robot):
    body = robot.modal_links[0].body
    nodes = dataclasses.replace(body.nodes, position=0.5 * body.nodes.position)
    with pytest.raises(ValueError, match="must reach by 0.8 m"):
        modal_manipulator(link=dataclasses.replace(body, nodes=nodes))


@pytest.mark.slow
def test_asim_leaves_less_than_rlfj(robot):
    """Figure 3.20 in shape: knowing the structure too leaves a smaller path error."""
    reference = smooth_reference(
        jnp.array([0.0, 0.9, -1.3]), jnp.array([0.15, 0.15, 0.15]), 0.5, settle=1.2
    )
    errors = {}
    for name, inverse in (("asim", ASIM()), ("rlfj", FlexibleJointInverse())):
        made = run(robot, robot, inverse, reference, CascadeMotorControl())
        errors[name] = float(made.judgement.path_error_integral_relative)
    assert errors["asim"] < 0.05 * errors["rlfj"]

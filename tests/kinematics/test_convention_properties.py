"""Rows of the tables 3-1 to 3-4 of [KinModell], claimed and found.

Determinants of the displacements that a convention makes are in closed form; each is
met at its zeros and beside them.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    JointKind,
    SerialChain,
    convention_properties,
    forward_kinematics,
    joint_properties,
    rotation_from_vector,
    to_dh,
    to_hayati,
    to_mixed,
    to_rpy,
    transform,
)

from tests.kinematics.arms import fanuc, kuka, mixed, planar, puma
from tests.kinematics.geometries import kr210, scara


HALF = np.pi / 2


def two(make, first, second=None, **options):
    """Two joints with the parameters `first`; the second one matters little."""
    second = [0.3] * len(first) if second is None else second
    return make(*np.stack([first, second], axis=1), **options)


def dh(alpha, a=0.5, **options):
    return two(SerialChain.from_dh, [0.2, 0.1, a, alpha], **options)


def hayati(a, alpha, beta, **options):
    return two(SerialChain.from_hayati, [0.2, a, alpha, beta], **options)


def wide(a, alpha, beta, **options):
    make = SerialChain.from_veitschegger_wu
    return two(make, [0.2, 0.1, a, alpha, beta], **options)


def rpy(angles, axis=(0.0, 0.0, 1.0)):
    """One joint; the axis is on the frame's x where the middle angle is a quarter."""
    return SerialChain.from_rpy([[0.4, 0.2, 0.3]] * 2, [angles] * 2, [axis] * 2)


def first(chain):
    return joint_properties(chain, 1)


def names(combinations):
    return [c.name for c in combinations]


# ---------------------------------------------------------------- Denavit-Hartenberg


@pytest.mark.parametrize("alpha", [0.0, np.pi])
@pytest.mark.parametrize("a", [0.5, 0.0])
def test_dh_loses_rank_for_parallel_axes(alpha, a):
    found = first(dh(alpha, a))
    # parallel: the tilt out of the plane; one line: the shift across it, too
    assert found.missing == (1 if a else 2)
    assert found.loses_rank and not found.is_complete
    assert found.amplification == np.inf
    assert "d_1" in names(found.redundant)
    # claimed, and right for finite parameters
    assert found.covers_all and len(found.parameters) == 4


@pytest.mark.parametrize("alpha", [0.3, HALF, -1.0])
@pytest.mark.parametrize("a", [0.5, 0.0])
def test_dh_has_full_rank_elsewhere(alpha, a):
    found = first(dh(alpha, a))
    assert found.is_complete and not found.loses_rank
    assert found.redundant == () and np.isfinite(found.amplification)


def test_dh_amplifies_with_the_square_of_the_angle():
    near, nearer = (first(dh(alpha)).amplification for alpha in (1e-2, 1e-3))
    # the determinant is the square of the sine
    assert nearer / near == pytest.approx(100.0, rel=1e-3)


def test_modified_dh_is_its_mirror():
    for alpha, missing in ((0.0, 1), (0.7, 0)):
        chain = SerialChain.from_modified_dh(
            np.array([0.3, alpha]), np.array([0.2, 0.5]), np.zeros(2), np.zeros(2)
        )
        # the second joint places axis 2; the first one does what the base does
        found = joint_properties(chain, 2)
        assert found.missing == missing and found.convention == "ModifiedDHJoints"
        assert len(joint_properties(chain, 1).redundant) == 4


def leaning(angle, direction):
    """Parallel axes 1 and 2, but for a lean of axis 2 about `direction`."""
    lean = rotation_from_vector(angle * jnp.asarray(direction))
    rotation = jnp.stack([jnp.eye(3), lean])
    axis = np.tile([0.0, 0, 1], (2, 1))
    return SerialChain.from_frames(rotation, [[0, 0, 0], [0.5, 0, 0]], axis)


def test_tables_claim_continuity_that_dh_lacks():
    # "Stetigkeit: ja": two geometries differ by a tenth of a milliradian
    flat, steep = (leaning(1e-4, d) for d in ([1.0, 0, 0], [0, 1.0, 0]))
    jump = np.abs(np.asarray(to_dh(flat).joints.theta - to_dh(steep).joints.theta))
    assert jump[0] == pytest.approx(HALF, abs=1e-3)
    assert np.abs(to_dh(flat).joints.d - to_dh(steep).joints.d)[0] > 1e3
    # Hayati and Mirmirani's parameters differ as the geometries do
    flat, steep = (to_hayati(chain).joints for chain in (flat, steep))
    for name in ("theta", "a", "alpha", "beta"):
        difference = getattr(flat, name) - getattr(steep, name)
        assert np.max(np.abs(difference)) < 2e-4


# ---------------------------------------------------------------- Hayati-Mirmirani


@pytest.mark.parametrize(
    ("a", "alpha", "beta"),
    [
        (0.0, 0.3, 0.4),  # meet in the origin
        (0.0, 0.0, 0.0),  # one line
        (0.5, HALF, 0.3),  # orthogonal
        (0.5, -HALF, 0.0),
        (0.5, 0.3, HALF),  # orthogonal, along x
    ],
)
def test_hayati_loses_rank_where_the_table_says(a, alpha, beta):
    found = first(hayati(a, alpha, beta))
    assert found.loses_rank and found.missing > 0 and not found.covers_all
    assert found.amplification == np.inf


@pytest.mark.parametrize(
    ("a", "alpha", "beta"), [(0.5, 0.0, 0.0), (0.2, 1.0, -0.7), (0.5, np.pi, 0.0)]
)
def test_hayati_has_full_rank_elsewhere(a, alpha, beta):
    found = first(hayati(a, alpha, beta))
    assert found.is_complete and not found.loses_rank and found.redundant == ()
    assert len(found.parameters) == 4


def test_hayati_determinant():
    # a cos(alpha) cos(beta)^2: half the length, or cosine, takes twice the parameters;
    # the second power of the last one are two displacements
    pairs = [
        (hayati(1e-3, 0.1, 0.1), hayati(5e-4, 0.1, 0.1)),
        (hayati(0.5, HALF - 1e-3, 0.1), hayati(0.5, HALF - 5e-4, 0.1)),
        (hayati(0.5, 0.1, HALF - 1e-3), hayati(0.5, 0.1, HALF - 5e-4)),
    ]
    for near, nearer in pairs:
        ratio = first(nearer).amplification / first(near).amplification
        assert ratio == pytest.approx(2, rel=1e-2)
    lost = [first(hayati(*p)).missing for p in ((0, 0.3, 0.3), (0.5, 0.3, HALF))]
    assert lost == [1, 2]


# ---------------------------------------------------------------- Veitschegger-Wu


def test_veitschegger_wu_loses_less_than_the_table_says():
    # axes that meet z, or are parallel to the x-y plane, and are complete all the same
    for a, alpha, beta in [(0.0, 0.5, 0.2), (0.5, HALF, 0.3), (0.5, 0.0, 0.0)]:
        found = first(wide(a, alpha, beta))
        assert found.is_complete and not found.loses_rank
        # five say four things
        assert len(found.parameters) == 5 and len(found.redundant) == 1


@pytest.mark.parametrize(
    ("a", "alpha", "beta", "missing"),
    [
        (0.5, 0.3, HALF, 1),  # points along x
        (0.0, 0.0, 0.4, 1),  # meets z in the origin, leans along x
        (0.0, 0.0, 0.0, 1),  # one line, which the convention was made for
        (0.0, 0.3, HALF, 1),
    ],
)
def test_veitschegger_wu_loses_rank(a, alpha, beta, missing):
    found = first(wide(a, alpha, beta))
    assert found.missing == missing and found.amplification == np.inf
    assert found.covers_all


def test_veitschegger_wu_dependence():
    # both conditions of the table at once: two turns about one line
    found = first(wide(0.0, HALF, 0.3))
    assert names(found.dependent) == ["beta_1"]
    assert dict(found.dependent[0].terms) == pytest.approx({"theta_1": 1.0})
    assert found.loses_rank and found.is_complete
    assert first(wide(0.1, HALF, 0.3)).dependent == ()
    assert first(wide(0.0, HALF - 0.1, 0.3)).dependent == ()


# ---------------------------------------------------------------- roll-pitch-yaw


@pytest.mark.parametrize("quarter", [HALF, -HALF])
def test_rpy_loses_rank_at_a_quarter_turn(quarter):
    found = first(rpy([0.3, quarter, -0.4]))
    assert names(found.dependent) == ["rpy_1_z"] and found.loses_rank
    # by -sin: the turns about x and z are one
    factors = dict(found.dependent[0].terms)
    assert factors == pytest.approx({"rpy_1_x": -np.sign(quarter)}, abs=1e-9)
    # the axis itself can still be placed, as it is not the lost direction
    assert found.is_complete and found.covers_all


@pytest.mark.parametrize("angle", [0.0, 1.0, HALF - 1e-3, np.pi])
def test_rpy_has_full_rank_elsewhere(angle):
    found = first(rpy([0.3, angle, -0.4]))
    assert not found.loses_rank and found.dependent == ()
    # six say four things
    assert len(found.parameters) == 6 and len(found.redundant) == 2


# ---------------------------------------------------------------- prismatic, chains


def test_a_prismatic_axis_has_no_place():
    slides = (JointKind.PRISMATIC, JointKind.REVOLUTE)
    found = first(dh(0.7, kinds=slides))
    # two parameters say all
    assert names(found.redundant) == ["d_1", "a_1"] and found.is_complete
    # parallel to a hinge: the tilt about y is still missing
    assert first(dh(0.0, kinds=slides)).missing == 1
    # Hayati and Mirmirani's tilts are enough, orthogonal or not
    for alpha in (0.0, HALF):
        found = first(hayati(0.0, alpha, 0.2, kinds=slides))
        assert found.is_complete
        assert len(found.redundant) == 2 and "a_1" in names(found.redundant)


@pytest.mark.slow
def test_whole_chains():
    found = convention_properties(fanuc()).joints
    assert [j.joint for j in found if not j.is_complete] == [2]
    assert [j.convention for j in found] == ["DHJoints"] * 6
    # lengths over the arm's size: millimetres and metres are the same
    metres = convention_properties(fanuc(1e-3)).joints
    for one, other in zip(found, metres):
        assert one.amplification == pytest.approx(other.amplification, rel=1e-9)
    repaired = convention_properties(to_mixed(fanuc())).joints
    assert all(j.is_complete for j in repaired)
    for chain in (kuka(), mixed(), to_rpy(puma())):
        assert all(j.is_complete for j in convention_properties(chain).joints)
    assert [j.missing for j in convention_properties(scara()).joints] == [1, 1, 1, 0]


@pytest.mark.slow
def test_table_is_readable():
    text = str(convention_properties(to_mixed(planar(1.0, 0.7, 0.2))))
    lines = text.splitlines()
    assert lines[0].split()[:3] == ["joint", "convention", "parameters"]
    assert lines[1].split()[:3] == ["1", "Hayati", "4"] and len(lines) == 4
    assert len({line.index(word) for line, word in zip(lines, ("conv", "Hay"))}) == 1
    text = str(convention_properties(planar(1.0, 0.7, 0.2)))
    assert "d_1" in text and "1 missing" in text and "inf" in text


def test_missing_displacement_is_what_no_parameters_make():
    # of parallel axes, a tilt about y; fitting it with parameters leaves it whole
    chain, tilt = dh(0.0), 1e-3
    target = transform(rotation_from_vector(jnp.array([0.0, tilt, 0.0])), jnp.zeros(3))
    first_link = forward_kinematics(
        SerialChain.from_dh(*[np.array([x]) for x in (0.2, 0.1, 0.5, 0.0)]),
        jnp.zeros(1),
    )
    found = joint_properties(chain, 1)
    assert found.missing == 1
    moved = np.asarray(first_link @ target)[:3, 2]
    nominal = np.asarray(first_link)[:3, 2]
    x = np.array([np.cos(0.2), np.sin(0.2), 0.0])
    # directions that small twists alpha reach are across x; this one is along
    assert abs((moved - nominal) @ x) == pytest.approx(tilt, rel=1e-6)


def test_refusals():
    with pytest.raises(ValueError, match="from 1 to 6, but is 0"):
        joint_properties(fanuc(), 0)
    with pytest.raises(ValueError, match="from 1 to 6, but is 7"):
        joint_properties(fanuc(), 7)
    with pytest.raises(ValueError, match="as structure"):
        convention_properties(kr210())

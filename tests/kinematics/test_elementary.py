"""Products of elementary transformations against the chains that they describe."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ChainParameters,
    DHJoints,
    Element,
    ElementaryProduct,
    HayatiJoints,
    JointKind,
    MixedJoints,
    RPYJoints,
    SerialChain,
    StructuredJoints,
    elementary_chain,
    elementary_pose,
    forward_kinematics,
    rotation_about,
    transform,
)
from elastax.kinematics._structured import JointStructure

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import fanuc, kuka, mixed


SLIDES, TURNS = JointKind.PRISMATIC, JointKind.REVOLUTE
RNG = np.random.default_rng(11)
ENDS = {
    "base": transform(
        rotation_about(jnp.array([0.6, 0.0, 0.8]), jnp.array(0.4)),
        jnp.array([0.1, -0.2, 0.3]),
    ),
    "tool": transform(
        rotation_about(jnp.array([0.0, 0.6, 0.8]), jnp.array(-1.3)),
        jnp.array([0.0, 0.1, 0.2]),
    ),
    "kinds": (TURNS, SLIDES, TURNS),
}


def table(columns):
    return RNG.uniform(-1, 1, (columns, 3))


def groups():
    zero = np.zeros(1)
    axis = np.array([[0.0, 0.6, 0.8]])
    return MixedJoints(
        (
            DHJoints(zero + 0.3, zero, zero + 0.4, zero - 0.5),
            HayatiJoints(zero + 0.1, zero + 0.2, zero + 0.02, zero - 0.03),
            RPYJoints(table(1)[:1], table(1)[:1], axis),
        )
    )


def right_angles():
    quarter = ((0, -1, 0), (1, 0, 0), (0, 0, 1))
    axis = (0, 1, 0)
    known = JointStructure(quarter, axis, False)
    own = JointStructure(None, None, True)
    turned = rotation_about(jnp.array([0.6, 0.0, 0.8]), jnp.array(0.7))[None]
    place = np.array([[0.1, 0.2, 0.3]])
    return StructuredJoints(
        turned, place, np.array([[0.6, 0.8, 0.0]]), (known, own, known)
    )


CHAINS = {
    "dh": SerialChain.from_dh(*table(4), **ENDS),
    "modified dh": SerialChain.from_modified_dh(*table(4), **ENDS),
    "hayati": SerialChain.from_hayati(*table(4), **ENDS),
    "veitschegger-wu": SerialChain.from_veitschegger_wu(*table(5), **ENDS),
    "rpy": mixed(),
    "frames": kuka(),
    "mixed": SerialChain.from_joints(groups(), **ENDS),
    "structured": SerialChain.from_joints(right_angles(), **ENDS),
}
each_chain = pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS.keys())


def coordinates(chain, rows=()):
    rng = np.random.default_rng(5)
    return jnp.asarray(rng.uniform(-1.5, 1.5, (*rows, chain.number)))


@pytest.mark.slow
@each_chain
def test_pose_is_that_of_the_chain(chain):
    factors, q = elementary_chain(chain), coordinates(chain)
    assert len(factors.joint_variables) == chain.number
    # algebra: some forty products of matrices of order one
    assert_close(
        elementary_pose(factors, q), forward_kinematics(chain, q), rtol=0, atol=1e-14
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["dh", "modified dh", "hayati", "veitschegger-wu", "rpy", "mixed"]
)
def test_names_are_those_of_the_chain(name):
    """A deviation by name moves the chain and the product alike."""
    chain = CHAINS[name]
    factors, parameters = elementary_chain(chain), ChainParameters.of(chain)
    # the rotation vectors of the ends are no elementary rotations
    shared = [n for n in parameters.names if n in factors.names]
    assert set(parameters.names) - set(shared) == {
        f"{end}_r{c}" for end in ("base", "tool") for c in "xyz"
    }
    parameters = parameters.select(shared)
    assert parameters.units == tuple(factors.units[factors.index(n)] for n in shared)
    rng = np.random.default_rng(6)
    amounts = jnp.asarray(rng.uniform(-0.1, 0.1, parameters.number))
    q = coordinates(chain)
    expected = jax.jit(lambda x: forward_kinematics(parameters.moved(x), q))(amounts)
    places = np.array([factors.index(n) for n in shared])
    values = factors.values.at[places].add(amounts)
    moved = ElementaryProduct(
        values, factors.directions, factors.constants, factors.places
    )
    assert_close(elementary_pose(moved, q), expected, rtol=0, atol=1e-14)


def test_joints_add_to_their_parameters():
    factors = elementary_chain(CHAINS["dh"])
    assert factors.index("q_1") == factors.index("theta_1")
    assert factors.index("q_2") == factors.index("d_2")
    alone = elementary_chain(CHAINS["hayati"], base=False, tool=False)
    assert "q_2" in alone.names and alone.units[alone.index("q_2")] == "m"
    assert alone.number == 13


def test_a_product_by_hand():
    """Translation, rotation about an inclined axis, constant; without joints."""
    axis = jnp.array([0.6, 0.0, 0.8])
    shift = transform(jnp.eye(3), jnp.array([0.5, 0.0, 0.0]))
    factors = ElementaryProduct.of(
        [
            Element.along((0, 1, 0), 0.3, "y"),
            Element.about(axis, 0.7, "turn"),
            Element.fixed(shift),
        ]
    )
    rotation = rotation_about(axis, jnp.array(0.7))
    position = jnp.array([0.0, 0.3, 0.0]) + 0.5 * rotation[:, 0]
    assert_close(elementary_pose(factors), transform(rotation, position), rtol=1e-14)
    assert factors.names == ("y", "turn") and factors.units == ("m", "rad")


@pytest.mark.slow
def test_batches_and_gradient():
    chain = fanuc(1e-3)
    factors, batch = elementary_chain(chain), coordinates(chain, (3,))
    loop = jnp.stack([elementary_pose(factors, q) for q in batch])
    mapped = jax.jit(jax.vmap(elementary_pose, (None, 0)))(factors, batch)
    # the same operations, in another order at most
    assert_close(mapped, loop, rtol=0, atol=1e-15)
    assert_gradient(elementary_pose, factors, batch[0])


def test_single_precision_stays_single():
    chain = jax.tree.map(lambda x: x.astype(jnp.float32), CHAINS["hayati"])
    assert elementary_chain(chain).values.dtype == jnp.float32


def test_refusals():
    factors = elementary_chain(CHAINS["dh"])
    with pytest.raises(ValueError, match="no variable `beta_1`"):
        factors.index("beta_1")
    with pytest.raises(ValueError, match="one coordinate per joint of 3"):
        elementary_pose(factors, jnp.zeros(2))
    with pytest.raises(ValueError, match="unit vectors"):
        ElementaryProduct.of([Element.about(jnp.array([1.0, 1.0, 0.0]), 0.1)])
    twice = [Element.along((1, 0, 0), 0.1, "a"), Element.along((0, 1, 0), 0.1, "a")]
    with pytest.raises(ValueError, match="names must differ"):
        ElementaryProduct.of(twice)
    with pytest.raises(ValueError, match="every joint from 0 on"):
        ElementaryProduct.of([Element.about((0, 0, 1), 0.1, joint=1)])
    with pytest.raises(ValueError, match="every value and every constant"):
        ElementaryProduct(np.zeros(1), np.zeros((0, 3)), np.zeros((0, 4, 4)), ())
    nested = SerialChain.from_joints(MixedJoints((groups(),)), **ENDS)
    with pytest.raises(ValueError, match="must not be mixed themselves"):
        elementary_chain(nested)

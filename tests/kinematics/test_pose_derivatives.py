"""Derivatives of poses against published matrices, nested jvps and each other."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ChainParameters,
    Element,
    ElementaryProduct,
    elementary_chain,
    elementary_jacobian,
    elementary_pose,
    forward_kinematics,
    jacobian,
    multi_indices,
    parameter_jacobian,
    pose_derivative,
    pose_gradient,
    pose_hessian,
    rotation_about,
    transform,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import fanuc, mixed


X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)


def rpy_elements(name, angles, position=None):
    """Elements of (3-11), in the order of the text."""
    elements = []
    if position is not None:
        elements += [
            Element.along(axis, position[k], f"{name}_t{'xyz'[k]}")
            for k, axis in ((2, Z), (1, Y), (0, X))
        ]
    return elements + [
        Element.about(axis, angles[k], f"{name}_{'xyz'[k]}")
        for k, axis in ((2, Z), (1, Y), (0, X))
    ]


def orders_of(factors, **orders):
    result = np.zeros(factors.number, int)
    for name, order in orders.items():
        result[factors.index(name)] = order
    return jnp.asarray(result)


def small():
    """Skew axes, both kinds of variables, a constant and two joints."""
    shift = transform(
        rotation_about(jnp.array([0.0, 0.6, 0.8]), jnp.array(0.5)),
        jnp.array([0.3, -0.1, 0.2]),
    )
    return ElementaryProduct.of(
        [
            Element.about(jnp.array([0.6, 0.0, 0.8]), 0.4, "first", joint=0),
            Element.along(X, 0.5, "length"),
            Element.fixed(shift),
            Element.about(Y, -0.7, "second"),
            Element.about(Z, 0.2, "third"),
            Element.along(jnp.array([0.0, 0.8, 0.6]), 0.3, "slide", joint=1),
        ]
    )


def test_published_third_derivative():
    case = load_vectors("003 (3-27)")[0]
    factors = ElementaryProduct.of(rpy_elements("D", case["inputs"]["Theta"]))
    actual = pose_derivative(factors, orders_of(factors, D_y=case["inputs"]["n"]))
    assert_close(actual[:3, :3], case["outputs"]["d3D"], rtol=case["tol"])


def test_published_derivatives_of_a_chain():
    """(3-30) and (3-31), whose print is lost."""
    case = load_vectors("003 (3-30/3-31) lost")[0]
    elements = []
    for name, part in case["inputs"].items():
        elements += rpy_elements(name, part["Theta"], part["t"])
    factors = ElementaryProduct.of(elements)
    derivative = jax.jit(pose_derivative)
    expected, tol = case["outputs"], case["tol"]
    second = derivative(factors, orders_of(factors, Tk_y=2))
    assert_close(second, expected["d2T_dThetay2"], rtol=tol, atol=tol)
    first = derivative(factors, orders_of(factors, Tk_tx=1))
    assert_close(first, expected["dT_dtx"], rtol=tol, atol=tol)


def test_published_number_of_terms():
    case = load_vectors("003 (3-36)")[0]
    indices = multi_indices(case["inputs"]["N"], case["inputs"]["k"])
    terms = {tuple(o): c for o, c in zip(indices.orders.tolist(), indices.coefficients)}
    assert len(terms) == case["outputs"]["n_terms"]
    assert sum(terms.values()) == case["outputs"]["sum_of_coefficients"]
    assert terms[1, 1, 1] == case["outputs"]["coefficient_111"]
    assert terms[2, 1, 0] == case["outputs"]["coefficient_210"]


@pytest.mark.parametrize(("number", "order"), [(1, 4), (4, 0), (5, 3), (24, 2)])
def test_terms_are_all_there(number, order):
    indices = multi_indices(number, order)
    rows = {tuple(row) for row in indices.orders.tolist()}
    assert len(rows) == len(indices.orders) == math.comb(number + order - 1, order)
    assert all(sum(row) == order for row in rows)
    assert indices.coefficients.sum() == number**order


# sequences of variables, up to the fifth order
SEQUENCES = [(0,), (3, 0), (1, 3), (0, 2, 2), (4, 2, 0, 0), (3, 3, 0, 2, 1), (2,) * 5]


@pytest.mark.slow
def test_any_order_is_nested_jvps():
    factors, q = small(), jnp.array([0.3, -0.2])

    def pose(values):
        moved = ElementaryProduct(
            values, factors.directions, factors.constants, factors.places
        )
        return elementary_pose(moved, q)

    def nested(sequence):
        function = pose
        for k in sequence:
            unit = jnp.zeros(5).at[k].set(1.0)
            function = lambda v, f=function, u=unit: jax.jvp(f, (v,), (u,))[1]
        return function(factors.values)

    expected = jax.jit(lambda: jnp.stack([nested(s) for s in SEQUENCES]))()
    orders = jnp.stack([jnp.bincount(jnp.array(s), length=5) for s in SEQUENCES])
    # one program for all multi-indices, traced orders
    every = jax.jit(jax.vmap(pose_derivative, (None, 0, None)))
    actual = every(factors, orders, q)
    assert_close(actual, expected, rtol=0, atol=1e-14)
    loop = jnp.stack([pose_derivative(factors, o, q) for o in orders])
    assert_close(actual, loop, rtol=0, atol=1e-15)
    # a rotation repeats itself after four orders, a translation is gone after one
    fourth = pose_derivative(factors, jnp.array([0, 0, 5, 0, 0]), q)
    assert_close(
        fourth, pose_derivative(factors, jnp.array([0, 0, 1, 0, 0]), q), rtol=0
    )
    assert not np.any(pose_derivative(factors, jnp.array([0, 2, 0, 0, 0]), q))
    assert_close(
        pose_derivative(factors, jnp.zeros(5, int), q),
        elementary_pose(factors, q),
        rtol=0,
        atol=1e-15,
    )


@pytest.mark.slow
@pytest.mark.parametrize("chain", [mixed(), fanuc(1e-3)], ids=["mixed", "fanuc"])
def test_first_and_second_derivatives(chain):
    """By the joints against autodiff of the chain, by the rest against any order."""
    factors = elementary_chain(chain, base=False)
    rng = np.random.default_rng(4)
    q = jnp.asarray(rng.uniform(-1.5, 1.5, chain.number))
    gradient, hessian = pose_gradient(factors, q), pose_hessian(factors, q)
    assert not np.any(gradient[:, 3]) and not np.any(hessian[:, :, 3])

    joints = np.array(factors.joint_variables)
    pose = lambda q: forward_kinematics(chain, q)
    both = jax.jit(lambda q: (jax.jacfwd(pose)(q), jax.jacfwd(jax.jacrev(pose))(q)))
    first, second = both(q)
    # algebra on lengths of some metres
    assert_close(gradient[joints], jnp.moveaxis(first, -1, 0), rtol=0, atol=1e-13)
    expected = jnp.moveaxis(second, (-2, -1), (0, 1))
    assert_close(hessian[joints][:, joints], expected, rtol=0, atol=1e-13)

    every = jax.jit(jax.vmap(pose_derivative, (None, 0, None)))
    chosen = np.linspace(0, factors.number - 1, 9).astype(int)
    pairs = [(i, j) for i in chosen for j in chosen if i <= j]
    rows = np.array([np.bincount(pair, minlength=factors.number) for pair in pairs])
    one_by_one = every(factors, jnp.asarray(rows), q)
    i, j = np.array(pairs).T
    assert_close(hessian[i, j], one_by_one, rtol=0, atol=1e-13)
    assert_close(hessian[j, i], one_by_one, rtol=0, atol=1e-13)


@pytest.mark.slow
def test_jacobian_by_joints_and_parameters():
    chain = fanuc(1e-3)
    factors, parameters = elementary_chain(chain), ChainParameters.of(chain)
    q = jnp.array([0.3, 1.2, -0.4, 0.5, 0.8, -1.1])
    actual = elementary_jacobian(factors, q)
    joints = np.array(factors.joint_variables)
    assert_close(actual[:, joints], jacobian(chain, q), rtol=0, atol=1e-14)
    expected = parameter_jacobian(parameters, q)
    # to first order the angles of the ends are the rotation vector
    same = {f"{e}_r{c}": f"{e}_rpy_{c}" for e in ("base", "tool") for c in "xyz"}
    columns = [factors.index(same.get(n, n)) for n in parameters.names]
    assert_close(actual[:, np.array(columns)], expected, rtol=0, atol=1e-13)


@pytest.mark.slow
def test_gradients():
    factors, q = small(), jnp.array([0.3, -0.2])
    orders = jnp.array([1, 1, 0, 2, 0])
    assert_gradient(lambda f, q: pose_derivative(f, orders, q), factors, q)
    assert_gradient(pose_hessian, factors, q)


def test_refusals():
    factors = small()
    with pytest.raises(ValueError, match="one order per variable of 5"):
        pose_derivative(factors, jnp.zeros(4, int))
    with pytest.raises(ValueError, match="`orders` must not be negative"):
        pose_derivative(factors, jnp.array([0, -1, 0, 0, 0]))
    with pytest.raises(ValueError, match="`number` must be positive"):
        multi_indices(0, 2)

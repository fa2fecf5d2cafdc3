"""Lie derivatives, relative degree, normal form and zero dynamics of known systems."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.analysis import (
    ControlSystem,
    SignalNames,
    find_equilibrium,
    input_lie_derivative,
    lie_derivative,
    linearise,
    normal_form,
    relative_degree,
    simulate_zero_dynamics,
    zero_dynamics,
)

from tests.analysis.textbook_systems import (
    cases,
    linear,
    planar_vtol,
    siso,
    slotine_cubic,
    van_der_pol,
)
from tests.analysis.two_link import two_link
from tests.helpers import assert_close, load_vectors


CASES = cases()


# ------------------------------------------------------------------ Lie derivatives


def test_lie_derivatives_of_the_text():
    """[Reiner2010] (A.1)."""
    beta = lambda x: x[0] ** 2 * x[1] + jnp.sin(x[2])
    f = lambda x: jnp.array([x[1], x[0] * x[2], -(x[1] ** 2)])
    g = lambda x: jnp.array([[1.0], [x[0]], [x[1] * x[2]]])
    vectors = load_vectors("A.1")
    assert vectors
    for vector in vectors:
        x = jnp.array(vector["inputs"]["x"])
        along = lie_derivative(f, beta)
        tol = vector["tol"]
        assert_close(along(x), vector["outputs"]["L_f"], rtol=tol)
        mixed = input_lie_derivative(g, along)(x)
        assert_close(mixed, [vector["outputs"]["L_g_L_f"]], rtol=tol)


def test_lie_derivatives_of_any_order():
    """Along a linear field they are c A^k x; order 0 is the function."""
    generator = np.random.default_rng(0)
    A, c, x = (generator.standard_normal(s) for s in ((4, 4), (4,), (4,)))
    for order in range(7):
        found = lie_derivative(lambda x: A @ x, lambda x: c @ x, order)(jnp.asarray(x))
        assert_close(found, c @ np.linalg.matrix_power(A, order) @ x, rtol=1e-12)
    with pytest.raises(ValueError, match="must not be negative"):
        lie_derivative(lambda x: x, lambda x: x, -1)


# ------------------------------------------------------------------ textbook systems


@pytest.mark.parametrize("name", CASES)
def test_textbook_system(name):
    case = CASES[name]
    found = zero_dynamics(case.system, case.x)
    assert found.form.degrees == case.degrees
    expected = np.sort_complex(np.array(case.eigenvalues, complex))
    size = np.abs(expected).max(initial=1.0)
    # a double zero is exact to the root of rounding
    double = name == "pendulum on a cart, angle"
    atol = (1e-7 if double else 1e-12) * size
    assert_close(found.eigenvalues, expected, rtol=case.rtol, atol=atol)
    verdicts = {
        "stable": found.is_stable,
        "unstable": found.is_unstable,
        "open": not found.is_stable and not found.is_unstable,
        "none": found.is_stable and not found.eigenvalues.size,
    }
    assert verdicts[case.verdict], found.verdict
    words = {"open": "does not decide", "none": "no zero dynamics"}
    assert words.get(case.verdict, f"{case.verdict} zero dynamics") in found.verdict


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "three states",
        "pendulum on a cart, cart",
        "planar VTOL",
        "quadruple tank, not minimum phase",
        "boost converter, voltage",
        "two by two, zero at 0.5",
    ],
)
def test_linearised_system_has_the_same_zeros(name):
    """The second route: QZ of the system matrix at the equilibrium."""
    case = CASES[name]
    found = zero_dynamics(case.system, case.x)
    x = jnp.asarray(case.x)
    model = linearise(case.system, x, found.form.holding_input(x))
    structure = model.zero_structure()
    assert structure.infinite == tuple(sorted(case.degrees))
    size = np.abs(np.asarray(found.eigenvalues)).max(initial=1.0)
    # real or imaginary parts that are zero come out as rounding of the largest
    assert_close(structure.finite, found.eigenvalues, rtol=1e-8, atol=1e-10 * size)


@pytest.mark.parametrize(("sign", "grows"), [(1.0, False), (-1.0, True)])
def test_cubic_zero_dynamics_by_simulation(sign, grows):
    """[SlotineLi1991] 6.1.3: x2' = -+ x2^3, which no linearisation decides.

    Closed form: x2(t) = x2(0) / sqrt(1 +- 2 x2(0)^2 t).
    """
    system = slotine_cubic(sign)
    form = normal_form(system, jnp.zeros(2))
    times = jnp.linspace(0.0, 0.4, 5)
    motion = jax.jit(lambda x: simulate_zero_dynamics(form, x, times))
    found = motion(jnp.array([0.0, 1.0]))
    factor = -2.0 if grows else 2.0
    assert_close(
        found[:, 1], 1.0 / np.sqrt(1.0 + factor * np.asarray(times)), rtol=1e-6
    )
    assert_close(found[:, 0], np.zeros(5), rtol=0, atol=1e-8)


# ---------------------------------------------------------------------- normal form


@pytest.fixture(scope="module")
def two_link_form():
    system = two_link()
    return normal_form(system, jnp.zeros(4))


def test_three_routes_to_the_zeros(two_link_form):
    """Strict normal form, chart of the zero manifold, and the linearised system."""
    form = two_link_form
    strict = eqx.filter_jit(lambda f: f.straightened_matrix())(form)
    chart = eqx.filter_jit(lambda f: jax.jacfwd(f.zero_rate)(jnp.zeros(2)))(form)
    zeros = linearise(form.system, jnp.zeros(4), jnp.zeros(1)).zeros()
    assert_close(zeros, [-292.1857496215 + 0j, 305.5786067643 + 0j], rtol=1e-9)
    for matrix in (strict, chart):
        assert_close(np.sort_complex(np.linalg.eigvals(matrix)), zeros, rtol=1e-9)


def test_coordinates_lead_there_and_back(two_link_form):
    form = two_link_form
    x = jnp.array([2e-3, 0.3, -1e-3, 0.2])
    assert_close(form.state(form.coordinates(x)), x, rtol=1e-9)


def test_no_input_moves_straightened_coordinates(two_link_form):
    """(3.9) away from the origin, to the error of the flow's sixteen steps."""
    form = two_link_form
    x = jnp.array([2e-2, 0.3, -1e-2, 0.2])
    slope = jax.jit(jax.jacfwd(form.straightened))(x)
    field = form.system.input_matrix(x)
    size = jnp.linalg.norm(slope, axis=1) * jnp.linalg.norm(field)
    assert np.all(np.abs((slope @ field)[:, 0]) < 1e-9 * np.asarray(size))


@pytest.mark.slow
def test_outputs_stay_at_zero(two_link_form):
    """Along the simulated zero dynamics, while the unstable mode grows."""
    form = two_link_form
    times = jnp.linspace(0.0, 0.01, 21)
    start = 1e-4 * form.basis @ jnp.array([0.0, 1.0])
    found = jax.jit(lambda x: simulate_zero_dynamics(form, x, times))(start)
    outputs = jax.vmap(form.system.output)(found)
    growth = np.linalg.norm(found[-1]) / np.linalg.norm(found[0])
    assert growth > 5.0
    size = np.abs(np.asarray(found)[:, 0]).max()
    assert np.abs(np.asarray(outputs)).max() < 1e-6 * size


@pytest.mark.slow
def test_zero_dynamics_differentiate_by_parameters():
    """Of the planar VTOL they are +-1/sqrt(epsilon)."""

    def matrix(epsilon):
        form = normal_form_of(epsilon)
        slope = jax.jacfwd(form.held_rate)(form.origin)
        return jnp.linalg.det(form.basis.T @ slope @ form.basis)

    base = normal_form(planar_vtol(0.25), jnp.zeros(6))

    def normal_form_of(epsilon):
        return eqx.tree_at(lambda f: f.system, base, planar_vtol(epsilon))

    # product of the eigenvalues: -1 / epsilon
    value, slope = jax.jit(jax.value_and_grad(matrix))(0.25)
    assert_close(value, -4.0, rtol=1e-9)
    assert_close(slope, 16.0, rtol=1e-9)


# ------------------------------------------------------------------------- refusals


def test_degree_that_is_not_defined_at_a_point():
    """[Khalil2002]: y = x1 + x2^2 has degree 1 but where x2 = 0."""
    system = van_der_pol(lambda x: x[0] + x[1] ** 2)
    assert relative_degree(system, jnp.array([0.2, 0.5])).degrees == (1,)
    with pytest.raises(ValueError, match="near it, but not at it"):
        relative_degree(system, jnp.zeros(2))


def test_ball_and_beam():
    """[Hauser1992b]: degree 3 away from rest, undefined where r w = 0."""
    names = SignalNames(("r", "rd", "angle", "w"), ("u",), ("r",))
    system = ControlSystem(
        lambda x, u: jnp.array(
            [
                x[1],
                0.7143 * (x[0] * x[3] ** 2 - 9.81 * jnp.sin(x[2])),
                x[3],
                u[0],
            ]
        ),
        lambda x: x[:1],
        names,
    )
    assert relative_degree(system, jnp.array([0.4, 0.1, 0.2, 0.5])).degrees == (3,)
    with pytest.raises(ValueError, match="derivative 3 of `r` near it"):
        relative_degree(system, jnp.zeros(4))


def test_refusals():
    one = np.eye(2)
    twice = linear([[0, 1], [0, 0]], [[0], [1]], [[1, 0], [0, 1]])
    with pytest.raises(ValueError, match="2 outputs cannot be set by 1 inputs"):
        relative_degree(twice, jnp.zeros(2))
    apart = linear([[0, 0], [0, 0]], [[1], [0]], [[0, 1]])
    with pytest.raises(ValueError, match="no input reaches the output `y1`"):
        relative_degree(apart, jnp.zeros(2))
    same = linear(-one, one, [[1, 1], [1, 1]])
    with pytest.raises(ValueError, match="decoupling matrix .* is singular"):
        relative_degree(same, jnp.zeros(2))
    curved = ControlSystem(
        lambda x, u: jnp.array([x[1], u[0] ** 3]),
        lambda x: x[:1],
        SignalNames.numbered(2, 1, 1),
    )
    with pytest.raises(ValueError, match="affine in the inputs"):
        relative_degree(curved, jnp.zeros(2))
    with pytest.raises(ValueError, match="`output` must have the shape"):
        wrong = ControlSystem(curved.rate, lambda x: x, SignalNames.numbered(2, 1, 1))
        relative_degree(wrong, jnp.zeros(2))
    with pytest.raises(ValueError, match="not finite"):
        relative_degree(van_der_pol(lambda x: 1.0 / x[0]), jnp.zeros(2))
    with pytest.raises(ValueError, match="must be zero at the state"):
        normal_form(van_der_pol(lambda x: x[0]), jnp.array([0.5, 0.0]))
    fall = siso(
        lambda x: jnp.array([x[1], -9.81, 1.0]),
        lambda x: jnp.array([0.0, 1.0, 0.0]),
        lambda x: x[0],
        3,
    )
    with pytest.raises(ValueError, match="must rest at the state"):
        zero_dynamics(fall, jnp.zeros(3))
    with pytest.raises(ValueError, match="no input moves exist for several"):
        normal_form(planar_vtol(0.25), jnp.zeros(6)).straightened(jnp.zeros(6))


def test_equilibria():
    system = ControlSystem(
        lambda x, u: jnp.array([x[1], -9.81 * jnp.sin(x[0]) - 0.1 * x[1] + u[0]]),
        lambda x: x[:1],
        SignalNames.numbered(2, 1, 1),
    )
    x, _ = find_equilibrium(system, jnp.array([0.3, 0.5]), jnp.array([2.0]))
    assert_close(x, [np.arcsin(2.0 / 9.81), 0.0], rtol=1e-12, atol=1e-12)
    x, u = find_equilibrium(system, jnp.zeros(2), jnp.zeros(1), output=jnp.array([0.7]))
    assert_close(u, [9.81 * np.sin(0.7)], rtol=1e-12)
    assert_close(x, [0.7, 0.0], rtol=1e-12, atol=1e-12)
    with pytest.raises(ValueError, match="no equilibrium near the first guess"):
        find_equilibrium(system, jnp.array([0.3, 0.5]), jnp.array([20.0]))

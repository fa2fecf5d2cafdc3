"""Linear models: poles, response, exchange, inverses, high gain, refusals."""

import control
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal
from elastax.analysis import (
    LinearModel,
    SignalNames,
    high_gain_condition,
    high_gain_inverse,
    inverse_model,
    linear_model_of,
    linearise,
)

from tests.analysis.two_link import two_link
from tests.helpers import assert_close, load_vectors


def oscillator(w=3.0, z=0.1) -> LinearModel:
    return LinearModel(
        [[0.0, 1.0], [-(w**2), -2 * z * w]],
        [[0.0], [1.0]],
        [[1.0, 0.0]],
        names=SignalNames(("x [m]", "v [m/s]"), ("f [N]",), ("x [m]",)),
    )


def random_model(seed: int, n=6, m=2, p=3) -> LinearModel:
    draw = np.random.default_rng(seed).standard_normal
    return LinearModel(draw((n, n)), draw((n, m)), draw((p, n)), draw((p, m)))


def of_transfer(numerator, denominator) -> LinearModel:
    return linear_model_of(control.tf(numerator, denominator))


# --------------------------------------------------------------- the text's example


@pytest.mark.parametrize("vector", load_vectors("Reiner 3.38"))
def test_linearised_two_link(vector):
    inputs = dict(vector["inputs"])
    model = linearise(two_link(**inputs), jnp.zeros(4), jnp.zeros(1))
    out, tol = vector["outputs"], vector["tol"]
    assert_close(model.A, out["A"], rtol=tol, atol=tol)
    assert_close(model.B[:, 0], out["B"], rtol=tol, atol=tol)
    assert_close(model.C[0], out["C"], rtol=tol, atol=tol)
    assert model.relative_degree() == (2,)
    assert model.names.states[2] == "phi_e"


@pytest.mark.parametrize("vector", load_vectors("Reiner 3.36"))
def test_accelerations_of_the_two_link(vector):
    inputs = dict(vector["inputs"])
    state = [inputs.pop(k) for k in ("phi_a", "dphi_a", "phi_e", "dphi_e")]
    torque = inputs.pop("tau_a")
    rate = two_link(**inputs).rate(jnp.array(state), jnp.array([torque]))
    assert_close(
        rate[jnp.array([1, 3])], vector["outputs"]["ddphi"], rtol=vector["tol"]
    )


@pytest.mark.parametrize("vector", load_vectors("Reiner 3.27"))
def test_printed_zero_dynamics_of_the_kr210(vector):
    """(3.26) with the printed constants, 4.393e-4 read as a power of ten."""
    given = vector["inputs"]
    C_1, C_2, C_3 = (given[name] for name in ("C1", "C2", "C3"))
    A = [[0.0, C_1], [C_3 * given["c_e"], C_2 * given["d_e"]]]
    poles = LinearModel(A, np.ones((2, 1)), np.ones((1, 2))).poles()
    expected = np.array(vector["outputs"]["eigenvalues"], complex)
    assert_close(poles, expected, rtol=vector["tol"])
    assert_close(C_1 * C_3, vector["outputs"]["C1C3"], rtol=vector["tol"])
    # the structure s^2 - K (d s + c): C_2 = 0.0244 is printed to three digits
    assert_close(C_1 * C_3, C_2, rtol=1e-3)


# ------------------------------------------------------------------ poles and modes

# tolerances of 1e-12 and 1e-14 in this file: rounding of the eigensolver, sizes of one


def test_modes_of_an_oscillator():
    modes = oscillator().modes()
    assert_close(modes.frequency, [3.0 / (2 * np.pi)] * 2, rtol=1e-12)
    assert_close(modes.damping_ratio, [0.1, 0.1], rtol=1e-12)
    damped = 3.0 * np.sqrt(1 - 0.01) / (2 * np.pi)
    assert_close(np.sort(modes.damped_frequency), [-damped, damped], rtol=1e-12)
    assert_close(np.sum(modes.participation, axis=0), [1.0, 1.0], rtol=1e-12)
    assert_close(modes.participation, np.full((2, 2), 0.5), rtol=1e-12)


def test_participation_tells_apart():
    """Two oscillators that do not touch: each mode has the states of its own."""
    one, two = np.asarray(oscillator(3.0).A), np.asarray(oscillator(20.0).A)
    A = np.block([[one, np.zeros((2, 2))], [np.zeros((2, 2)), two]])
    modes = LinearModel(A, np.ones((4, 1)), np.ones((1, 4))).modes()
    assert_close(modes.participation[2:, :2], np.zeros((2, 2)), rtol=0, atol=1e-14)
    assert_close(np.sum(modes.participation[2:, 2:], axis=0), [1.0, 1.0], rtol=1e-12)


def test_poles_are_jitted_and_sorted():
    A = np.diag([-1.0, -5.0, 2.0])
    model = LinearModel(A, np.ones((3, 1)), np.ones((1, 3)))
    assert_close(
        jax.jit(lambda m: m.poles())(model),
        [-5.0 + 0j, -1.0 + 0j, 2.0 + 0j],
        rtol=1e-12,
    )


# -------------------------------------------------------- response against the peers


def test_frequency_response_against_control():
    model = random_model(0)
    omega = np.logspace(-2, 2, 9)
    peer = control.frequency_response(model.to_control(), omega).complex
    found = jax.jit(lambda m: m.frequency_response(omega))(model)
    assert_close(found, np.moveaxis(peer, 2, 0), rtol=1e-10, atol=1e-12)
    assert_close(model.static_gain(), model.transfer(0.0)[0].real, rtol=1e-10)


def test_exchange_there_and_back():
    model = random_model(1)
    for peer in (model.to_control(), model.to_scipy()):
        assert_close(linear_model_of(peer).A, model.A, rtol=0)
        assert_close(linear_model_of(peer).D, model.D, rtol=0)
    named = oscillator().to_control()
    assert linear_model_of(named).names == oscillator().names
    assert of_transfer([1.0, 2.0], [1.0, 4.0, 3.0]).A.shape == (2, 2)
    lti = scipy.signal.TransferFunction([1.0], [1.0, 2.0])
    assert_close(linear_model_of(lti).poles(), [-2.0 + 0j], rtol=1e-12)
    with pytest.raises(ValueError, match="continuous time, but has a step of 0.1"):
        linear_model_of(control.ss(-1, 1, 1, 0, 0.1))


def test_channel():
    model = random_model(2)
    part = model.channel(["u2"], ["y3", 0])
    assert part.names.outputs == ("y3", "y1")
    assert_close(part.C, np.asarray(model.C)[[2, 0]], rtol=0)
    assert_close(part.D, np.asarray(model.D)[[2, 0]][:, [1]], rtol=0)
    with pytest.raises(ValueError, match="no input `u3`; there are u1, u2"):
        model.channel(["u3"], ["y1"])
    with pytest.raises(ValueError, match="no output 5"):
        model.channel([0], [5])


# ---------------------------------------------------------------- minimal realisation


def test_minimal_realisation():
    """Hidden states of both kinds in random coordinates fall away."""
    core = random_model(3, n=3, m=1, p=2)
    generator = np.random.default_rng(4)
    n = 7
    A, B, C = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((2, n))
    A[:3, :3], B[:3], C[:, :3] = core.A, core.B, core.C
    A[3:5, 3:5], B[3:5] = -np.diag([1.0, 2.0]), 1.0  # not seen
    A[5:, 5:], C[:, 5:] = -np.diag([3.0, 4.0]), 1.0  # not reached
    A[3:5, :3], A[:3, 5:] = generator.standard_normal((2, 3)), 1.0
    turn = generator.standard_normal((n, n))
    back = np.linalg.inv(turn)
    whole = LinearModel(turn @ A @ back, turn @ B, C @ back, core.D)
    small = whole.minimal()
    assert small.A.shape == (3, 3)
    s = np.array([0.3 + 1j, 2j])
    assert_close(small.transfer(s), whole.transfer(s), rtol=1e-9)
    same = lambda m: np.sort_complex(np.round(np.asarray(m.poles()), 9))
    assert_close(same(small), same(core), rtol=1e-8)


# ---------------------------------------------------------------------------- inverse


def test_inverse_of_a_system():
    """Transfer times inverse is one; the poles of the inverse are the zeros."""
    generator = np.random.default_rng(5)
    draw = generator.standard_normal
    A, B, C = draw((6, 6)), draw((6, 2)), draw((2, 6))
    C[0] -= C[0] @ B @ np.linalg.pinv(B)  # degree 2 for the first output
    model = LinearModel(A, B, C)
    assert model.relative_degree() == (2, 1)
    inverse = inverse_model(model)
    assert inverse.names.inputs == ("y1", "y1'", "y1''", "y2", "y2'")
    poles = np.asarray(inverse.poles())
    for z in model.zeros():
        assert np.abs(poles - z).min() < 1e-8 * abs(z)
    assert len(poles) == len(model.zeros())
    for s in (0.7j, 1.3 + 2j):
        y = model.transfer(s)[0]
        derivatives = np.stack([y[0], s * y[0], s**2 * y[0], y[1], s * y[1]])
        assert_close(
            inverse.transfer(s)[0] @ derivatives, np.eye(2) + 0j, rtol=1e-9, atol=1e-9
        )


def test_inverse_of_a_proper_system_needs_no_derivatives():
    """Only d_G = 0: the text's condition is the other way round."""
    model = of_transfer([1.0, 5.0, 6.0], [1.0, 2.0, 5.0])
    inverse = inverse_model(model)
    assert inverse.names.inputs == ("y[0]",)
    assert_close(inverse.transfer(1j), 1.0 / model.transfer(1j), rtol=1e-12)


@pytest.mark.parametrize("vector", load_vectors("Reiner 3.3"))
def test_high_gain_inverse(vector):
    model = of_transfer([1.0, 2.0], [1.0, 4.0, 3.0])
    approximate = high_gain_inverse(model, vector["inputs"]["k_inv"]).transfer(2j)
    exact = 1.0 / model.transfer(2j)
    for found, name in ((approximate, "approx"), (exact, "exact")):
        value = vector["outputs"][name]
        assert_close(found[0, 0, 0], value["re"] + 1j * value["im"], rtol=vector["tol"])
    assert high_gain_condition(model).holds


@pytest.mark.parametrize("vector", load_vectors("Reiner 3.3 caution"))
def test_high_gain_of_three_lags_is_unstable(vector):
    model = of_transfer([1.0], [1.0, 3.0, 3.0, 1.0])
    poles = high_gain_inverse(model, vector["inputs"]["k_inv"]).poles()
    expected = [p["re"] + 1j * p["im"] for p in vector["outputs"]["poles"]]
    assert_close(poles, expected, rtol=vector["tol"])
    condition = high_gain_condition(model)
    assert not condition.holds
    assert "3 asymptotes" in condition.reason


@pytest.mark.parametrize(
    ("numerator", "denominator", "holds"),
    [
        ([1.0], [1.0, 1.0], True),
        ([-1.0], [1.0, 1.0], False),
        ([1.0, -1.0], [1.0, 2.0, 1.0], False),
        ([1.0], [1.0, 2.0, 1.0], True),
        ([1.0], [1.0, -2.0, 1.0], False),
        ([1.0, 1.0], [1.0, 0.5, 2.0, 3.0], False),
        ([1.0, 0.2], [1.0, 2.0, 2.0, 3.0], True),
    ],
)
def test_high_gain_condition_is_what_large_gains_show(numerator, denominator, holds):
    model = of_transfer(numerator, denominator)
    condition = high_gain_condition(model)
    assert condition.holds is holds, condition.reason
    poles = high_gain_inverse(model, 1e7).poles()
    assert bool(np.all(np.asarray(poles).real < 0)) is holds


# --------------------------------------------------------------------------- refusals


def test_refusals():
    one = np.eye(2)
    with pytest.raises(ValueError, match="`B` of LinearModel must have the shape"):
        LinearModel(one, np.ones((3, 1)), np.ones((1, 2)))
    with pytest.raises(ValueError, match="holds NaN"):
        LinearModel(one * np.nan, np.ones((2, 1)), np.ones((1, 2)))
    with pytest.raises(ValueError, match="`names.inputs` must be 1 names"):
        names = SignalNames.numbered(2, 2, 1)
        LinearModel(one, np.ones((2, 1)), np.ones((1, 2)), names=names)
    wide = LinearModel(-one, one, [[1.0, 0.0]])
    with pytest.raises(ValueError, match="1 outputs and 2 inputs"):
        inverse_model(wide)
    with pytest.raises(ValueError, match="one input and one output"):
        high_gain_inverse(wide, 10.0)
    with pytest.raises(ValueError, match="decoupling matrix .* is singular"):
        inverse_model(LinearModel(-one, one, [[1.0, 1.0], [1.0, 1.0]]))
    with pytest.raises(ValueError, match="no input reaches the output `y1`"):
        LinearModel(-one, [[1.0], [0.0]], [[0.0, 1.0]]).relative_degree()


def test_single_precision_is_refused():
    with jax.enable_x64(False):
        with pytest.raises(ValueError, match="double precision"):
            LinearModel(-np.eye(2), np.ones((2, 1)), np.ones((1, 2)))

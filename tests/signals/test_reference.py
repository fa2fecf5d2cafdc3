"""Reference motions: construction, derivatives, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.signals import (
    BesselFilter,
    Reference,
    check_recording_signal,
)

from tests.helpers import assert_close, assert_gradient


DT = 1e-3


def sine(order=3, count=1001, dt=DT):
    """Times and exact derivatives of a motion of two axes."""
    t = dt * np.arange(count)
    amplitude, omega = np.array([0.5, 1.2]), np.array([4.0, 7.0])
    phase = omega * t[:, None]
    rows = [
        amplitude * omega**k * np.sin(phase + k * np.pi / 2) for k in range(order + 1)
    ]
    return t, np.stack(rows)


def bump(t):
    """A smooth rest-to-rest motion of two axes within the first 0.4 s."""
    s = jnp.clip(t / 0.4, 0.0, 1.0)
    return jnp.array([1.0, -0.3]) * (s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


def test_properties():
    t, rows = sine()
    poses = np.broadcast_to(np.eye(4), (len(t), 4, 4))
    reference = Reference(t, rows, poses)
    assert reference.order == 3
    assert_close(reference.dt, DT, rtol=1e-12)
    assert_close(reference.positions, rows[0], rtol=0.0)
    reference.require_order(3)
    with pytest.raises(ValueError, match="filter of too low an order.*`order=4`"):
        reference.require_order(4)


def test_from_samples_is_the_filter():
    t, rows = sine(count=60)
    filter = BesselFilter(4, 20.0)
    reference = Reference.from_samples(t, rows[0], filter=filter, max_step=0.02)
    assert reference.order == 4
    direct = filter.apply(rows[0], reference.dt, 4)
    assert_close(reference.derivatives, direct, rtol=1e-14)
    with pytest.raises(ValueError, match="filter of too low an order"):
        Reference.from_samples(t, rows[0], filter=filter, order=5)


def test_filtered_derivatives_follow_a_sine():
    """In the steady state every derivative is scaled and shifted by the filter."""
    t, rows = sine(count=1501)
    filter = BesselFilter(6, 20.0)
    reference = Reference.from_samples(t, rows[0], filter=filter)
    omega, sampling = np.array([4.0, 7.0]), 2 * np.pi / DT
    gain = np.asarray(filter.frequency_response(omega))
    for k in range(5):
        phasor = np.array([0.5, 1.2]) * gain * (1j * omega) ** k
        desired = np.imag(phasor * np.exp(1j * omega * t[-1]))
        # The linear pieces lower the signal by (omega dt)^2 / 12; their ripple, at
        # most (omega dt)^2 / 8, comes through the filter at the sampling frequency.
        ripple = (float(filter.rate()) / sampling) ** 6 * (sampling / omega) ** k
        tolerance = (omega * DT) ** 2 * (1 / 12 + ripple / 8) * np.abs(phasor)
        miss = np.abs(np.asarray(reference.derivatives[k, -1]) - desired)
        assert np.all(miss < tolerance), (k, miss / tolerance)


@pytest.mark.slow
def test_error_of_the_highest_derivative():
    """What the linear pieces cost where the input enters directly, and its remedy."""
    filter = BesselFilter(4, 20.0)
    build = lambda **options: Reference.from_position_function(
        bump, 0.4, DT, filter=filter, settle=0.1, **options
    )
    coarse, fine = build(oversampling=1), build(oversampling=32)
    curvature = jax.vmap(jax.jacfwd(jax.jacfwd(bump)))(coarse.times)
    # At the kinks of the acceleration, at 0 and 0.4 s, its size is not defined.
    inner = np.r_[10:390, 410:500]
    expected = float(filter.rate()) ** 4 * DT**2 / 12 * curvature
    bias = fine.derivatives[4] - coarse.derivatives[4]
    peak = jnp.max(jnp.abs(expected), axis=0)
    # The next term of the expansion is of the relative size rate dt.
    miss = (bias - expected) / peak[None]
    assert np.max(np.abs(miss[inner])) < float(filter.rate()) * DT
    medium = build(oversampling=8).derivatives[4] - fine.derivatives[4]
    ratio = jnp.max(jnp.abs(bias), axis=0) / jnp.max(jnp.abs(medium), axis=0)
    # 8^2 and 32^2: the error falls with the square.
    assert_close(ratio, np.full(2, (1 - 1 / 1024) / (1 / 64 - 1 / 1024)), rtol=0.05)


def test_settling_brings_rest():
    filter = BesselFilter(5, 20.0)
    reference = Reference.from_position_function(
        bump, 0.4, DT, filter=filter, order=5, settle=0.5, oversampling=1
    )
    assert reference.times.shape == (901,)
    assert_close(reference.times[-1], 0.9, rtol=1e-12)
    assert_close(reference.positions[-1], jnp.array([1.0, -0.3]), rtol=1e-12)
    rate = float(filter.rate())
    rest = reference.derivatives[1:, -1] / rate ** np.arange(1, 6)[:, None]
    assert_close(rest, jnp.zeros((5, 2)), rtol=0.0, atol=1e-13)
    # The filtered motion ends later than its input by about the delay.
    late = float(reference.rest_time()) - 0.4
    assert 0.0 < late < 3 * float(filter.delay())
    # Holding the samples by hand is the same.
    t = DT * np.arange(901)
    held = Reference.from_samples(t, jax.vmap(bump)(t), filter=filter, order=5)
    scale = rate ** np.arange(6)[:, None, None]
    same = held.derivatives / scale
    assert_close(reference.derivatives / scale, same, rtol=0.0, atol=1e-13)


def test_rest_time():
    t = 0.1 * np.arange(11)
    speed = np.zeros((11, 2))
    speed[2:5, 0] = 1.0
    speed[3:8, 1] = [4e-3, 2e-3, 1e-3, 3.9e-6, 5e-7]
    rows = np.stack([np.zeros_like(speed), speed])
    # Axis 1 is judged by its own small peak: 4e-3 at sample 3, 1e-3 at sample 5.
    assert_close(Reference(t, rows).rest_time(), 0.5, rtol=1e-12)
    assert_close(Reference(t, rows).rest_time(0.6), 0.4, rtol=1e-12)
    # Rounding of angles at rest is no motion.
    shaking = np.stack(
        [np.full((11, 2), 1.5), 1e-15 * (-1.0) ** np.arange(22).reshape(11, 2)]
    )
    assert_close(Reference(t, shaking).rest_time(), 0.0, rtol=0.0)
    many = jnp.stack([rows, np.roll(rows, 1, axis=1)])
    times = jax.jit(jax.vmap(lambda rows: Reference(t, rows).rest_time()))(many)
    assert_close(times, jnp.array([0.5, 0.6]), rtol=1e-12)
    with pytest.raises(ValueError, match="1 are needed"):
        Reference(t, rows[:1]).rest_time()


def test_interpolant():
    t, rows = sine()
    interpolant = Reference(t, rows).interpolant(1)
    time = 0.61234
    omega = np.array([4.0, 7.0])
    desired = np.array([0.5, 1.2]) * omega * np.cos(omega * time)
    # Hermite: (omega dt)^4 / 384 of the amplitude.
    assert_close(interpolant(time), desired, rtol=0.0, atol=1e-10)
    with pytest.raises(ValueError, match="4 are needed"):
        Reference(t, rows).interpolant(3)


def test_from_derivatives():
    t, rows = sine()
    assert_close(Reference.from_derivatives(t, rows).derivatives, rows, rtol=0.0)
    # Jumps of the highest derivative are no contradiction.
    jerk = np.where(t < 0.5, 1.0, -1.0)[:, None]
    integrate = lambda y: np.concatenate(
        [np.zeros((1, 1)), np.cumsum(0.5 * DT * (y[1:] + y[:-1]), axis=0)]
    )
    acceleration = (0.5 - np.abs(t - 0.5))[:, None]
    velocity = integrate(acceleration)
    rows = np.stack([integrate(velocity), velocity, acceleration, jerk])
    Reference.from_derivatives(t, rows)
    # An axis at rest.
    Reference.from_derivatives(t, np.zeros((3, len(t), 2)))


@pytest.mark.parametrize(
    "spoil",
    [
        pytest.param(lambda speed: 1.02 * speed, id="scale"),
        pytest.param(lambda speed: -speed, id="sign"),
        pytest.param(lambda speed: np.rad2deg(speed), id="degrees"),
        pytest.param(lambda speed: speed[:, ::-1], id="axes"),
        pytest.param(lambda speed: np.roll(speed, 20, axis=0), id="late"),
    ],
)
def test_wrong_derivatives_are_refused(spoil):
    t, rows = sine(order=1)
    rows = np.stack([rows[0], spoil(rows[1])])
    with pytest.raises(ValueError, match=r"`derivatives\[1\]` must be the time deriv"):
        Reference.from_derivatives(t, rows)


@pytest.mark.slow
def test_jit_and_vmap():
    filter = BesselFilter(3, 30.0)
    t, rows = sine(count=40)

    def last(size):
        reference = Reference.from_samples(t, size * rows[0], filter=filter, order=3)
        return reference.derivatives[:3, -1]

    sizes = jnp.array([1.0, 2.0])
    loop = jnp.stack([last(size) for size in sizes])
    mapped = jax.jit(jax.vmap(last))(sizes)
    assert_close(mapped, loop, rtol=1e-11)
    assert_gradient(last, jnp.asarray(0.7))
    held = jax.jit(
        lambda p: (
            Reference.from_samples(t, p, filter=filter, order=3, settle=0.01).positions
        )
    )
    assert held(rows[0]).shape == (50, 2)


def test_refusals_of_recordings():
    t, rows = sine(count=50)
    values = rows[0].copy()
    check_recording_signal(t, values, 0.02)
    values[17, 1] = np.nan
    with pytest.raises(
        ValueError, match=r"is nan at sample 17 \(t = 0.017 s\), axis 1"
    ):
        check_recording_signal(t, values)
    values = rows[0].copy()
    values[30:, 0] += 2 * np.pi
    check_recording_signal(t, values)
    with pytest.raises(ValueError, match=r"must not jump.*sample 30 .*, axis 0"):
        check_recording_signal(t, values, np.array([0.02, 0.1]))
    with pytest.raises(ValueError, match="must not jump"):
        filter = BesselFilter(4, 20.0)
        Reference.from_samples(t, values, filter=filter, max_step=0.1)
    with pytest.raises(ValueError, match="`max_step` must be positive"):
        check_recording_signal(t, values, 0.0)
    with pytest.raises(ValueError, match=r"must have the shape \(times, joints\)"):
        check_recording_signal(t[:-1], values)


def test_refusals_of_times_and_shapes():
    t, rows = sine(count=50)
    late = t.copy()
    late[20:] += 2e-5
    with pytest.raises(ValueError, match="`times` must be uniform.*sample 20"):
        Reference(late, rows)
    with pytest.raises(ValueError, match="`times` must increase.*sample 9"):
        Reference(np.where(np.arange(50) == 9, t[8], t), rows)
    with pytest.raises(ValueError, match="`times` must be finite.*sample 3"):
        Reference(np.where(np.arange(50) == 3, np.inf, t), rows)
    with pytest.raises(ValueError, match="`times` must hold at least two"):
        Reference(t[:1], rows[:, :1])
    with pytest.raises(ValueError, match="`derivatives`.* must have the shape"):
        Reference(t[:-1], rows)
    with pytest.raises(ValueError, match=r"`tool_poses` must have the shape"):
        Reference(t, rows, np.zeros((49, 4, 4)))
    rows[2, 7, 1] = np.inf
    with pytest.raises(ValueError, match=r"`derivatives\[2\]`.*inf at sample 7"):
        Reference(t, rows)
    filter = BesselFilter(4, 20.0)
    with pytest.raises(ValueError, match="`duration` and `dt` must be positive"):
        Reference.from_position_function(bump, 0.4, 0.0, filter=filter)
    with pytest.raises(ValueError, match="`oversampling` must be positive"):
        Reference.from_position_function(bump, 0.4, DT, filter=filter, oversampling=0)
    with pytest.raises(ValueError, match="`settle` must not be negative"):
        Reference.from_samples(t, rows[0], filter=filter, settle=-1.0)


def test_recorded_reference(data_dir):
    """A KUKA KR300: the controller's reference passes, a time shift does not."""
    path = data_dir / "kuka_kr300" / "kr300_10s_FF_A.mat"
    if not path.is_file():
        pytest.skip(f"{path.name} is absent")
    loadmat = pytest.importorskip("scipy.io").loadmat
    recording = loadmat(path, simplify_cells=True)["rec"]
    degrees = [recording["ref_pos_deg"], recording["ref_vel_simple_deg_per_s"]]
    rows = np.deg2rad(np.stack(degrees)).transpose(0, 2, 1)
    t = 0.004 * np.arange(rows.shape[1])
    Reference.from_derivatives(t, rows, tolerance=1e-4)
    with pytest.raises(ValueError, match="time shifts"):
        Reference.from_derivatives(t, np.stack([rows[0], np.roll(rows[1], 3, 0)]))
    reference = Reference.from_samples(
        t, rows[0], filter=BesselFilter(4, 20.0), settle=0.5, max_step=0.01
    )
    # Filtered and recorded speeds agree but for the delay.
    shift = float(BesselFilter(4, 20.0).delay()) / 0.004
    k = np.arange(len(t))
    for axis in range(6):
        moved = np.interp(k, k + shift, rows[1, :, axis])
        miss = np.asarray(reference.derivatives[1, : len(t), axis]) - moved
        assert np.sqrt(np.mean(miss**2)) < 0.02 * np.sqrt(np.mean(moved**2))

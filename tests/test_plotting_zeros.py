"""Figures of poles, zeros and maps: what they show, and that they draw."""

import io

import jax.numpy as jnp
import numpy as np
import pytest
from elastax.analysis import LinearModel, LinkZeros, PoseFigures, SignalNames, ZeroMap
from elastax.plotting import (
    plot_bode,
    plot_frequency_map,
    plot_nyquist,
    plot_poles_and_zeros,
    plot_zero_map,
    plot_zeros_along_link,
)


def model(zero: float) -> LinearModel:
    names = SignalNames(("x", "v"), ("force [N]",), ("place [m]",))
    return LinearModel(
        [[0.0, 1.0], [-9.0, -0.6]], [[0.0], [1.0]], [[-zero, 1.0]], names=names
    )


MODELS = {"left": model(-2.0), "right": model(2.0)}


def drawn(figure) -> str:
    """Draws it, and gives all its texts."""
    figure.savefig(io.BytesIO(), format="png")
    texts = [t.get_text() for t in figure.findobj(lambda x: hasattr(x, "get_text"))]
    return "\n".join(texts)


def test_poles_and_zeros():
    text = drawn(plot_poles_and_zeros(MODELS, limit=5.0))
    for word in ("left", "right", "poles", "zeros", "real part [1/s]"):
        assert word in text
    figure = plot_poles_and_zeros(MODELS)
    whole = figure.axes[0]
    circles = [line for line in whole.lines if line.get_marker() == "o"]
    assert [float(line.get_xdata()[0]) for line in circles] == pytest.approx(
        [-2.0, 2.0]
    )


def test_bode_and_nyquist():
    frequencies = np.geomspace(0.01, 10.0, 50)
    text = drawn(plot_bode(MODELS, frequencies))
    assert "frequency [Hz]" in text and "from force [N]" in text
    assert "|place [m]|" in text and "phase [deg]" in text
    figure = plot_bode(MODELS, frequencies)
    size = figure.axes[0].lines[0].get_ydata()
    response = np.asarray(MODELS["left"].frequency_response(2 * np.pi * frequencies))
    np.testing.assert_allclose(size, np.abs(response[:, 0, 0]), rtol=1e-12)
    assert "real part" in drawn(plot_nyquist(MODELS, frequencies))


def a_map(regular=True) -> ZeroMap:
    second, third = np.meshgrid([0.0, 0.1, 0.2], [0.5, 0.6])
    poses = np.zeros((6, 3))
    poses[:, 1], poses[:, 2] = second.ravel(), third.ravel()
    one = jnp.ones(6)
    figures = PoseFigures(
        zeros=jnp.ones((6, 2), complex),
        poles=-jnp.ones((6, 4), complex),
        largest_real=jnp.array([1.0, 5.0, 20.0, -1.0, 3.0, 4.0]),
        right_zeros=jnp.array([1.0, 1.0, 1.0, 0.0, 1.0, 1.0]),
        slowest_right=jnp.array([1.0, 5.0, 20.0, jnp.inf, 3.0, 4.0]),
        frequency=5.0 * one + jnp.arange(6.0),
        damping_ratio=0.01 * one,
        decoupling=0.1 * one,
        regular=jnp.array([True, regular, True, True, True, True]),
    )
    return ZeroMap(jnp.asarray(poses), figures, (2, 2))


def test_maps():
    found = a_map(regular=False)
    assert (found.masked, found.unstable) == (1, 4)
    text = drawn(plot_zero_map(found))
    assert "A2 [deg]" in text and "A3 [deg]" in text
    assert "largest real part of a zero [1/s]" in text
    text = drawn(plot_frequency_map(found))
    assert "first eigenfrequency [Hz]" in text and "damping ratio [%]" in text


def test_zeros_along_a_link():
    place = jnp.linspace(0.1, 1.0, 10)
    found = LinkZeros(
        place,
        jnp.stack([place - 0.55, -place - 1.0], axis=1).astype(complex),
        jnp.array([-1.0 + 2.0j, -1.0 - 2.0j]),
        jnp.ones(10),
    )
    assert found.critical_position() == pytest.approx(0.55)
    assert "first right zero at 0.550" in drawn(plot_zeros_along_link(found))
    none = LinkZeros(place, -jnp.ones((10, 2), complex), found.poles, jnp.ones(10))
    assert np.isnan(none.critical_position())
    drawn(plot_zeros_along_link(none))

"""Modal bodies: vectors, Lagrange, variants, other coordinates, refusals."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.structure import (
    NOMINAL,
    VARIANT_1,
    VARIANT_2,
    VARIANT_3,
    VARIANT_4,
    VARIANT_5,
    BodyDetail,
    BodyNodes,
    element_motion,
    free_body,
    inertial_forces,
    no_nodes,
    point_mass_body,
)

from tests.helpers import assert_close, assert_gradient, load_vectors


VARIANTS = (VARIANT_1, VARIANT_2, VARIANT_3, VARIANT_4, VARIANT_5)
GENERATOR = np.random.default_rng(3)
MODES = 3


def random_body(curved=True, discs=True):
    """Five points with three modes, of no particular kind."""
    draw = GENERATOR.standard_normal
    curvature = draw((5, 3, MODES, MODES))
    turned = draw((5, 3, 3))
    return point_mass_body(
        jnp.asarray(GENERATOR.uniform(0.5, 2.0, 5)),
        jnp.asarray(draw((5, 3))),
        jnp.asarray(draw((5, 3, MODES))),
        jnp.diag(jnp.array([40.0, 90.0, 160.0])),
        damping=0.1 * jnp.eye(MODES),
        curvatures=jnp.asarray(curvature + np.swapaxes(curvature, 2, 3))
        if curved
        else None,
        discs=jnp.asarray(turned @ np.swapaxes(turned, 1, 2)) if discs else None,
        rotations=jnp.asarray(draw((5, 3, MODES))) if discs else None,
        nodes=no_nodes(MODES),
        mode_names=("a", "b", "c"),
    )


BODY = random_body()
MOTION = tuple(
    jnp.asarray(GENERATOR.standard_normal(n)) for n in (3, 3, 3, MODES, MODES, MODES)
)


def test_vector_of_an_element():
    (vector,) = load_vectors("2.20")
    x = {key: jnp.array(value) for key, value in vector["inputs"].items()}
    v, a = element_motion(
        x["v_R"],
        x["a_R"],
        x["omega"],
        x["domega"],
        x["c"],
        x["u"],
        x["du"],
        x["ddu"],
    )
    assert_close(v, vector["outputs"]["v"], rtol=vector["tol"])
    assert_close(a, vector["outputs"]["a"], rtol=vector["tol"])


def test_vector_of_a_second_order_displacement():
    (vector,) = load_vectors("2.21")
    x = {key: np.array(value) for key, value in vector["inputs"].items()}
    curved = np.stack([x["Phi_x"], x["Phi_y"], x["Phi_z"]])[None]
    nodes = BodyNodes(
        np.zeros((1, 3)), x["Phi"][None], np.zeros((1, 3, 3)), curved, ("tip",)
    )
    u = nodes.displacement(nodes.index("tip"), jnp.array(x["q"]))
    assert_close(u, vector["outputs"]["u"], rtol=vector["tol"])


def test_vector_of_the_rigid_blocks():
    (vector,) = load_vectors("2.22")
    x = {key: jnp.array(value) for key, value in vector["inputs"].items()}
    body = dataclasses.replace(
        BODY.selected([]),
        mass=x["m"],
        first_moment=x["m"] * x["d_CM"],
        J_0=x["J"],
    )
    matrix = body.mass_matrix(jnp.zeros(0))
    forces = matrix @ jnp.concatenate([x["a_R"], x["domega"]])
    assert_close(forces[:3], vector["outputs"]["force"], rtol=vector["tol"])
    assert_close(forces[3:], vector["outputs"]["moment"], rtol=vector["tol"])


def test_vector_of_three_masses():
    (vector,) = load_vectors("Reiner 3.72")
    inputs, outputs, tol = vector["inputs"], vector["outputs"], vector["tol"]
    x = {key: jnp.array(value) for key, value in inputs.items()}
    body = point_mass_body(
        x["m_i"],
        x["c_i"],
        x["Phi_i"],
        jnp.eye(2),
        nodes=no_nodes(2),
        mode_names=("a", "b"),
    )
    forces = inertial_forces(
        body, x["a_R"], x["omega"], x["domega"], x["q"], x["qd"], x["qdd"]
    )
    C_t, C_r = body.coupling_at(x["q"], 1)
    values = {
        "m": body.mass,
        "d_CM": body.first_moment_at(x["q"]) / body.mass,
        "J": body.inertia_at(x["q"]),
        "C_t": C_t,
        "C_r": C_r,
        "M_e": body.M_e,
        "force": forces.force,
        "moment": forces.moment,
        "modal": forces.modal,
    }
    for name, value in values.items():
        assert_close(value, jnp.array(outputs[name]), rtol=tol, atol=tol)


def test_forces_are_those_of_the_kinetic_energy():
    # Lagrange in quasi-velocities: dp/dt + omega x p, and v x p for the moment
    a, omega, domega, eta, etad, etadd = MOTION
    v = jnp.array([0.3, -1.2, 0.7])

    def energy(z, eta):
        return 0.5 * z @ BODY.mass_matrix(eta) @ z

    z = jnp.concatenate([v, omega, etad])
    # components of the velocity change by the acceleration less omega x v
    zd = jnp.concatenate([a - jnp.cross(omega, v), domega, etadd])
    momentum, rate = jax.jvp(jax.grad(energy), (z, eta), (zd, etad))
    p, moment = momentum[:3], momentum[3:6]
    expected = jnp.concatenate(
        [
            rate[:3] + jnp.cross(omega, p),
            rate[3:6] + jnp.cross(omega, moment) + jnp.cross(v, p),
            rate[6:] - jax.grad(energy, argnums=1)(z, eta),
        ]
    )
    forces = inertial_forces(BODY, *MOTION)
    assert_close(jnp.concatenate(forces), expected, rtol=1e-12, atol=1e-11)


def test_forces_of_points_by_their_accelerations():
    # masses without second-order displacement: (3.72) is exact for them
    body = random_body(curved=False, discs=False)
    generator = np.random.default_rng(8)
    m, c = generator.uniform(0.5, 2.0, 4), generator.standard_normal((4, 3))
    phi = generator.standard_normal((4, 3, MODES))
    body = point_mass_body(
        m, c, phi, jnp.eye(MODES), nodes=no_nodes(MODES), mode_names=tuple("abc")
    )
    a, omega, domega, eta, etad, etadd = MOTION
    forces = np.zeros(3), np.zeros(3), np.zeros(MODES)
    for k in range(4):
        u, ud, udd = phi[k] @ eta, phi[k] @ etad, phi[k] @ etadd
        _, acceleration = element_motion(
            jnp.zeros(3), a, omega, domega, jnp.asarray(c[k]), u, ud, udd
        )
        force = m[k] * np.asarray(acceleration)
        forces[0][:] += force
        forces[1][:] += np.cross(c[k] + np.asarray(u), force)
        forces[2][:] += phi[k].T @ force
    for ours, expected in zip(inertial_forces(body, *MOTION), forces, strict=True):
        assert_close(ours, expected, rtol=1e-12, atol=1e-12)
    assert_close(body.C_t1, np.zeros((MODES, MODES, 3)), rtol=0.0)
    swapped = np.swapaxes(np.asarray(body.C_r1), 0, 1)
    assert_close(body.C_r1, -swapped, rtol=1e-14, atol=1e-14)


def test_mass_matrix_and_bias_make_up_the_forces():
    a, omega, domega, eta, etad, etadd = MOTION
    matrix, bias = free_body(BODY, omega, eta, etad)
    total = matrix @ jnp.concatenate([a, domega, etadd]) + bias
    elastic = jnp.concatenate([jnp.zeros(6), BODY.K_e @ eta + BODY.D_e @ etad])
    forces = jnp.concatenate(inertial_forces(BODY, *MOTION)) + elastic
    assert_close(total, forces, rtol=1e-12, atol=1e-12)
    assert jnp.all(jnp.linalg.eigvalsh(BODY.mass_matrix(0.0 * eta)) > 0)


def test_named_matrices_are_those_of_the_terms():
    _, omega, _, eta, etad, _ = MOTION
    still = jnp.zeros(3)
    flat = dataclasses.replace(BODY, C_t1=0.0 * BODY.C_t1, J_2=0.0 * BODY.J_2)
    rest = 0.0 * eta
    forces = inertial_forces(flat, still, omega, still, rest, etad, rest)
    turning = jnp.einsum("kab,k,b->a", flat.G_r, etad, omega)
    turning = turning + jnp.cross(omega, flat.J_0 @ omega)
    drift = jnp.einsum("kla,k,l->a", flat.C_r1, etad, etad)
    assert_close(forces.moment, turning + drift, rtol=1e-12, atol=1e-12)
    x, y, z = omega
    squares = jnp.stack([x * x, y * y, z * z, x * y, y * z, x * z])
    modal = jnp.einsum("kla,l,a->k", flat.G_e, etad, omega) + flat.O_e0 @ squares
    assert_close(forces.modal, modal, rtol=1e-12, atol=1e-12)
    moving = inertial_forces(BODY, still, omega, still, eta, rest, rest)
    pull = (BODY.O_e0 + jnp.einsum("klj,l->kj", BODY.O_e1, eta)) @ squares
    assert_close(moving.modal, pull, rtol=1e-12, atol=1e-12)


def test_free_fall_leaves_the_modes_at_rest():
    gravity = jnp.array([0.3, -9.7, 1.1])
    matrix, bias = free_body(BODY, jnp.zeros(3), jnp.zeros(MODES), jnp.zeros(MODES))
    weight = matrix[:, :3] @ gravity
    fall = jnp.linalg.solve(matrix, weight - bias)
    expected = jnp.concatenate([gravity, jnp.zeros(3 + MODES)])
    assert_close(fall, expected, rtol=1e-12, atol=1e-11)


def test_variants_leave_out_what_they_say():
    a, omega, domega, eta, etad, etadd = MOTION
    gravity = jnp.array([0.0, 0.0, -9.81])

    def forces(detail, **changes):
        motion = dict(a=a, omega=omega, domega=domega, eta=eta, etad=etad, etadd=etadd)
        return inertial_forces(
            BODY.with_detail(detail), **(motion | changes), gravity=gravity
        )

    nominal = forces(NOMINAL)
    for detail in VARIANTS:
        assert not detail.is_nominal
        assert not np.allclose(forces(detail).modal, nominal.modal)
    # (3.73): the rigid body, and modes that only the speed drives
    first = forces(VARIANT_1)
    rigid = forces(NOMINAL, eta=0.0 * eta, etad=0.0 * eta, etadd=0.0 * eta)
    assert_close(first.force, rigid.force, rtol=1e-12)
    assert_close(first.moment, rigid.moment, rtol=1e-12)
    x, y, z = omega
    squares = jnp.stack([x * x, y * y, z * z, x * y, y * z, x * z])
    modal = BODY.M_e @ etadd + BODY.O_e0 @ squares
    assert_close(first.modal, modal, rtol=1e-12)
    # 3 and 4 differ by the weight on the modes, 2 and 3 by the terms with the speed
    C_t, _ = BODY.coupling_at(eta, 1)
    third, fourth = forces(VARIANT_3), forces(VARIANT_4)
    assert_close(fourth.modal - third.modal, -C_t @ gravity, rtol=1e-11)
    assert_close(fourth.force, third.force, rtol=1e-14)
    still = dict(omega=0.0 * omega)
    assert_close(
        forces(VARIANT_2, **still).moment, forces(VARIANT_3, **still).moment, rtol=1e-12
    )
    # 5 is nominal in the undeformed body but for the growth of the coupling
    rest = dict(eta=0.0 * eta, etad=0.0 * etad)
    for ours, whole in zip(forces(VARIANT_5, **rest), forces(NOMINAL, **rest)):
        assert_close(ours, whole, rtol=1e-12)


def test_other_coordinates_give_the_same_motion():
    a, omega, domega, eta, etad, etadd = MOTION
    matrix = jnp.asarray(GENERATOR.standard_normal((MODES, MODES)))
    other = BODY.transformed(matrix, ("x", "y", "z"))
    new = tuple(jnp.linalg.solve(matrix, x) for x in (eta, etad, etadd))
    forces = inertial_forces(BODY, *MOTION)
    moved = inertial_forces(other, a, omega, domega, *new)
    assert_close(moved.force, forces.force, rtol=1e-10, atol=1e-10)
    assert_close(moved.moment, forces.moment, rtol=1e-10, atol=1e-10)
    assert_close(moved.modal, matrix.T @ forces.modal, rtol=1e-10, atol=1e-10)
    eigen = other.in_eigenmodes()
    assert_close(eigen.M_e, np.eye(MODES), rtol=0.0, atol=1e-12)
    assert_close(eigen.frequencies(), BODY.frequencies(), rtol=1e-11)
    stiffness = np.asarray(eigen.K_e)
    expected = np.diag((2 * np.pi * np.asarray(BODY.frequencies())) ** 2)
    assert_close(stiffness, expected, rtol=1e-9, atol=1e-9 * expected.max())
    assert eigen.mode_names[0].startswith("mode 1, ")
    again = eigen.in_eigenmodes()
    assert_close(again.C_t0, eigen.C_t0, rtol=1e-9, atol=1e-9)


def test_selected_modes_and_damping_ratio():
    eigen = BODY.in_eigenmodes().with_damping_ratio(0.02)
    two = eigen.selected([2, 0])
    assert two.mode_names == (eigen.mode_names[2], eigen.mode_names[0])
    assert_close(two.C_r1[0, 1], eigen.C_r1[2, 0], rtol=1e-14)
    rates = 4.0 * np.pi * 0.02 * np.asarray(eigen.frequencies())[[2, 0]]
    assert_close(np.diag(two.D_e), rates, rtol=1e-12)


def test_gradient_and_batches():
    law = lambda *motion: jnp.concatenate(inertial_forces(BODY, *motion))
    assert_gradient(law, *MOTION)
    batch = tuple(jnp.stack([x, -0.5 * x, x**2]) for x in MOTION)
    loop = jnp.stack([law(*(x[k] for x in batch)) for k in range(3)])
    assert_close(jax.jit(jax.vmap(law))(*batch), loop, rtol=1e-12, atol=1e-12)


def changed(**changes):
    return dataclasses.replace(BODY, **changes)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: changed(mass=0.0), "`mass` must be positive"),
        (lambda: changed(M_e=-np.eye(MODES)), "`M_e` of `body` must be positive"),
        (lambda: changed(K_e=-np.eye(MODES)), "`K_e` of `body` must not have negative"),
        (lambda: changed(K_e=np.tri(MODES)), "`K_e` of `body` must be symmetric"),
        (lambda: changed(C_t0=np.zeros((2, 3))), "must have the shape"),
        (lambda: changed(mode_names=("a",)), "must name its 3 modes"),
        (lambda: changed(nodes=no_nodes(2)), "must move by its 3 modes"),
        (
            lambda: changed(C_t1=np.arange(27.0).reshape(3, 3, 3)),
            "`C_t1` of `body` must be symmetric",
        ),
        (lambda: BodyDetail(inertia=1), "`inertia` must be one of"),
        (lambda: BODY.nodes.index("tip"), "there is no node `tip`"),
        (lambda: BODY.with_damping_ratio(-0.1), "`ratio` must not be negative"),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ValueError, match=message):
        make()

"""Mass properties of shapes agree with closed forms and with integrals, and impossible shapes are refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.rigid.orientation import exponential, rotation_matrices
from proxbench.problems.motion.bodies.rigid.polyhedron import convex_polyhedron
from proxbench.problems.motion.bodies.rigid.shapes import Box, Capsule, Cylinder, Shape, Sphere

length = st.floats(0.01, 100.0)


def profile(shape: Shape, z: np.ndarray) -> np.ndarray:
    """Return the radius of a body of revolution at heights z."""
    if isinstance(shape, Cylinder):
        return np.full(len(z), shape.radius)
    half = shape.length / 2 if isinstance(shape, Capsule) else 0.0
    return np.sqrt(np.maximum(shape.radius**2 - np.maximum(np.abs(z) - half, 0.0) ** 2, 0.0))


@pytest.mark.parametrize("shape", [Sphere(0.7), Capsule(0.3, 1.1), Capsule(1.2, 0.2), Cylinder(0.4, 0.9)])
def test_volume_and_inertia_of_bodies_of_revolution_are_integrals_over_discs(shape: Shape) -> None:
    top = shape.length / 2 if isinstance(shape, Cylinder) else shape.bounding_radius
    edges = np.linspace(-top, top, 200_001)
    z, step = 0.5 * (edges[1:] + edges[:-1]), edges[1] - edges[0]
    areas = np.pi * profile(shape, z) ** 2
    across, along = areas * (profile(shape, z) ** 2 / 4 + z**2), areas * profile(shape, z) ** 2 / 2
    assert shape.volume == pytest.approx(areas.sum() * step, rel=1e-7)
    assert shape.inertia == pytest.approx(np.array([across.sum(), across.sum(), along.sum()]) * step, rel=1e-7)


@pytest.mark.parametrize(
    "shape", [Sphere(0.7), Capsule(0.3, 1.1), Capsule(1.2, 0.2), Cylinder(0.4, 0.9), Cylinder(0.4, 0.1)]
)
def test_a_sphere_of_the_thickness_of_a_body_of_revolution_reaches_its_surface(shape: Shape) -> None:
    top = shape.length / 2 if isinstance(shape, Cylinder) else shape.bounding_radius
    z = np.linspace(-top, top, 20_001)
    nearest = min(np.hypot(z, profile(shape, z)).min(), top)
    assert shape.thickness == pytest.approx(2.0 * nearest, rel=1e-7)


@given(radius=length)
def test_a_capsule_without_length_is_a_sphere(radius: float) -> None:
    short = Capsule(radius, 1e-12 * radius)
    assert short.volume == pytest.approx(Sphere(radius).volume)
    assert short.inertia == pytest.approx(Sphere(radius).inertia)
    assert short.bounding_radius == pytest.approx(radius)


@given(seed=st.integers(0, 2**32 - 1))
def test_turning_the_corners_of_a_polyhedron_changes_neither_volume_nor_moments(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(8, 3))
    corners /= np.linalg.norm(corners, axis=1)[:, None]  # all of them are corners of their hull
    rotation = rotation_matrices(exponential(rng.normal(size=(1, 3))))[0]
    shape, _ = convex_polyhedron(corners)
    turned, _ = convex_polyhedron(corners @ rotation.T + rng.normal(size=3))
    assert turned.volume == pytest.approx(shape.volume, rel=1e-9)
    assert turned.inertia == pytest.approx(shape.inertia, rel=1e-7)
    assert turned.bounding_radius == pytest.approx(shape.bounding_radius)


def test_a_prism_of_many_sides_has_the_inertia_of_a_cylinder() -> None:
    """The error of an inscribed polygon of n sides falls with 1/n²."""
    angles = 2 * np.pi * np.arange(32) / 32
    corners = np.array([[np.cos(a), np.sin(a), z] for a in angles for z in (-0.5, 0.5)])
    shape, _ = convex_polyhedron(corners)
    assert np.sort(shape.inertia) == pytest.approx(
        np.sort(Cylinder(1.0, 1.0).inertia), rel=4 / 3 * np.pi**2 / 32**2 * 1.1
    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sphere(0.0), "radius of a sphere must be positive and finite, got 0.0"),
        (lambda: Capsule(0.1, -1.0), "length of a capsule must be positive"),
        (lambda: Cylinder(float("nan"), 1.0), "radius of a cylinder must be positive"),
        (lambda: Box((1.0, 0.0, 1.0)), r"size\[1\] of a box must be positive"),
        (lambda: Box((1.0, 1.0)), "three edge lengths"),
        (lambda: Box(1.0), "three edge lengths"),  # type: ignore[arg-type]
        (lambda: Sphere("a"), "radius of a sphere must be positive and finite, got 'a'"),  # type: ignore[arg-type]
        (lambda: Sphere(1e-200), "radius of a sphere must be 1e-30 to 1e[+]30 m, got 1e-200"),
    ],
)
def test_shapes_without_volume_are_refused(make: object, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        make()  # type: ignore[operator]

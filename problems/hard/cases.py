"""The cases of the suite ``hard`` by name, in groups."""

from collections.abc import Callable
from functools import partial
from itertools import chain

import numpy as np

from ..contact.problem import ContactProblem
from ..contact.transformations import in_units
from . import degenerate, joints, mixed, rods, spheres, stacks, supports, wedges
from .bodies import WEIGHT
from .families import (
    Family,
    LinkedFamily,
    random_braced_problem,
    random_linked_problem,
    random_problem,
    random_spectrum_problem,
    single_precision,
)
from .rods import CRITICAL_FRICTION
from .stacks import bottom_heavy_masses, top_heavy_masses

Maker = Callable[[], ContactProblem]

_MASSES = {
    "10": np.ones(10),
    "100": np.ones(100),
    "10-top-heavy": top_heavy_masses(10, 100.0),
    "2-top-heavy": top_heavy_masses(2, 1e6),
    **{f"{n}-top-1e{k}": top_heavy_masses(n, 10.0**k) for n, k in ((2, 4), (2, 8), (10, 4), (10, 6), (10, 8))},
    **{f"100-top-1e{k}": top_heavy_masses(100, 10.0**k) for k in (4, 8)},
    **{f"{n}-bottom-1e{k}": bottom_heavy_masses(n, 10.0**k) for n, k in ((2, 8), (10, 4), (10, 8), (100, 8))},
    "10-growing-1e8": np.geomspace(1.0, 1e8, 10),
    "10-shrinking-1e8": np.geomspace(1.0, 1e8, 10)[::-1],
    "100-alternating-1e4": np.resize([1.0, 1e4], 100),
}
"""Masses of stacks [kg], from below."""

_ANGLES = {"below": -1e-9, "critical": 0.0, "above": 1e-9}
"""Angles of inclines minus the critical angle [rad]."""

_MILLIGRAM = {"mass": 1e-6, "length": 1e-6}
_TONNE = {"mass": 1e3, "length": 1e3}

_RANK = np.append(np.random.default_rng(5).random(20), np.zeros(40))
"""Eigenvalues of a G of rank 20 [1/kg]."""


def _in_units(make: Maker, **units: float) -> ContactProblem:
    return in_units(make(), **units).problem


_tower_of_ten = partial(stacks.sliding_tower, np.ones(10))

CASE_GROUPS: dict[str, dict[str, Maker]] = {
    "supports": {
        **{f"hard-supports-{n}": partial(supports.block_on_supports, n) for n in (2, 4, 8, 32, 128, 512)},
        **{f"hard-resting-block-{n}": partial(supports.resting_block, n, 0.5) for n in (2, 8, 64, 512)},
        "hard-resting-block-mu10": partial(supports.resting_block, 8, 10.0),
        "hard-identical-contacts": partial(supports.identical_contacts, 8),
        "hard-identical-contacts-512": partial(supports.identical_contacts, 512),
        "hard-duplicated-slider": supports.duplicated_slider,
        "hard-duplicated-slider-100": partial(supports.duplicated_slider, 100),
        "hard-duplicated-slider-mu10": partial(supports.duplicated_slider, 10, 10.0),
        "hard-sliding-block": supports.sliding_block,
        **{f"hard-sliding-block-{n}": partial(supports.sliding_block, 0.3, n) for n in (32, 512)},
        "hard-sticking-box": supports.sticking_box,
        **{f"hard-sticking-box-{n * n}": partial(supports.sticking_box, 1e-3, n) for n in (5, 16)},
    },
    "stacks": {
        **{f"hard-stack-{key}": partial(stacks.stack, values) for key, values in _MASSES.items()},
        **{f"hard-tower-{n}": partial(stacks.sliding_tower, np.ones(n)) for n in (3, 10, 100)},
        "hard-tower-10-top-1e4": partial(stacks.sliding_tower, top_heavy_masses(10, 1e4)),
        "hard-tower-10-bottom-1e8": partial(stacks.sliding_tower, bottom_heavy_masses(10, 1e8)),
        "hard-scaled-rows": stacks.scaled_stack,
        **{f"hard-scaled-rows-{n}": partial(stacks.scaled_stack, n) for n in (3, 15)},
        **{f"hard-scaled-tower-{n}": partial(stacks.scaled_tower, n) for n in (10, 30)},
        "hard-cradle-3": partial(stacks.cradle, 3, 1.0),
        "hard-cradle-10": partial(stacks.cradle, 10, 0.5),
        "hard-cradle-100": partial(stacks.cradle, 100, 1.0),
    },
    "wedges": {
        "hard-groove-frictionless": partial(wedges.v_groove, 0.0),
        "hard-groove": partial(wedges.v_groove, 0.3),
        "hard-groove-mu10": partial(wedges.v_groove, 10.0),
        "hard-groove-narrow-frictionless": partial(wedges.v_groove, 0.0, np.radians(5.0)),
        "hard-groove-narrow-mu1": partial(wedges.v_groove, 1.0, np.radians(5.0)),
        "hard-groove-narrow-mu10": partial(wedges.v_groove, 10.0, np.radians(1.0)),
        "hard-groove-flat-mu10": partial(wedges.v_groove, 10.0, np.radians(89.0)),
        "hard-chimney": partial(wedges.chimney, 1.0),
        "hard-chimney-mu10": partial(wedges.chimney, 10.0),
        "hard-arch-3-frictionless": partial(wedges.arch, 3, 0.0),
        "hard-arch-30-frictionless": partial(wedges.arch, 30, 0.0),
        "hard-arch-3": partial(wedges.arch, 3, 0.3),
        "hard-arch-30": partial(wedges.arch, 30, 0.3),
        "hard-arch-3-mu10": partial(wedges.arch, 3, 10.0),
        "hard-arch-10-mu1": partial(wedges.arch, 10, 1.0),
        "hard-arch-30-mu10": partial(wedges.arch, 30, 10.0),
        "hard-parallel-1e-3": partial(wedges.nearly_parallel, 4, 1e-3, 0.0),
        "hard-parallel-1e-8": partial(wedges.nearly_parallel, 4, 1e-8, 0.0),
        "hard-parallel-friction-1e-3": partial(wedges.nearly_parallel, 4, 1e-3, 0.5),
        "hard-parallel-friction-1e-8": partial(wedges.nearly_parallel, 50, 1e-8, 0.5),
    },
    "rods": {
        "hard-counterexample": partial(rods.rod, (-0.0981, 1.0), 2.0, ("slip-",)),
        "hard-counterexample-mu4": partial(rods.rod, (-0.0981, 1.0), 4.0, ("slip-",)),
        "hard-counterexample-mu10": partial(rods.rod, (-0.0981, 1.0), 10.0, ("slip-",)),
        "hard-painleve-jam": partial(rods.rod, (-0.0981, -1.0), 2.0, ("stick",)),
        "hard-painleve-jam-light": partial(rods.pressing_rod, 2.0, 1e-6),
        "hard-painleve-jam-heavy": partial(rods.pressing_rod, 2.0, 1e6),
        "hard-painleve-jam-20": partial(rods.jammed_rods, 20),
        "hard-three-solutions": partial(rods.rod, (0.01, -1.0), 2.0, ("open", "slip+", "stick")),
        "hard-three-solutions-light": partial(rods.leaving_rod, 2.0, 1e-6),
        "hard-three-solutions-heavy": partial(rods.leaving_rod, 2.0, 1e6),
        "hard-three-solutions-3": partial(rods.undecided_rods, (1.0, 1e-2, 1e2)),
        "hard-pressing-rod-mu0.5": partial(rods.pressing_rod, 0.5),
        "hard-pressing-rod-mu1.2": partial(rods.pressing_rod, 1.2),
        "hard-pressing-rod-below": partial(rods.pressing_rod, CRITICAL_FRICTION - 1e-3),
        "hard-pressing-rod-critical": partial(rods.pressing_rod, CRITICAL_FRICTION),
        "hard-pressing-rod-above": partial(rods.pressing_rod, CRITICAL_FRICTION + 1e-3),
        "hard-pressing-rod-mu10": partial(rods.pressing_rod, 10.0),
        "hard-leaving-rod-below": partial(rods.leaving_rod, CRITICAL_FRICTION - 1e-3),
        "hard-leaving-rod-above": partial(rods.leaving_rod, CRITICAL_FRICTION + 1e-3),
        "hard-leaving-rod-mu1.4": partial(rods.leaving_rod, 1.4),
        "hard-leaving-rod-mu10": partial(rods.leaving_rod, 10.0),
        "hard-leaving-rods-20": partial(rods.opening_rods, 20),
        "hard-many-rods": partial(rods.many_rods, 100),
    },
    "spheres": {
        **{
            f"hard-incline-mu{mu:g}-{word}": partial(spheres.incline, mu, _ANGLES[word])
            for mu in (0.1, 1.0, 10.0)
            for word in _ANGLES
        },
        "hard-inclines-30": partial(spheres.inclines, 30),
        "hard-rolling-sphere": partial(spheres.incline, 0.3, 0.0, 3.5),
        "hard-rolling-sphere-below": partial(spheres.incline, 0.3, -1e-9, 3.5),
        "hard-rolling-sphere-above": partial(spheres.incline, 0.3, 1e-9, 3.5),
        "hard-rolling-spheres-30": partial(spheres.inclines, 30, 3.5),
        "hard-sliding-sphere": partial(spheres.incline, 0.3, 0.1, 3.5),
        "hard-oblique-impact": partial(spheres.oblique_impacts, 1, 0.5, 0.3),
        "hard-oblique-impacts-21": partial(spheres.oblique_impacts, 21, 0.5, 0.3),
        "hard-oblique-impacts-1001": partial(spheres.oblique_impacts, 1001, 0.9, 2.0),
        "hard-scattered-100": partial(spheres.scattered, 100),
        "hard-scattered-3000": partial(spheres.scattered, 3000),
    },
    "joints": {
        "hard-chain-10": partial(joints.chain, np.ones(10)),
        "hard-chain-10-pulled": partial(joints.chain, np.ones(10), 1.0),
        "hard-chain-10-bottom-1e4": partial(joints.chain, bottom_heavy_masses(10, 1e4)),
        "hard-chain-100": partial(joints.chain, np.ones(100)),
        "hard-chain-100-pulled": partial(joints.chain, np.linspace(1.0, 2.0, 100), 1.0),
        "hard-four-bar": partial(joints.parallelogram, 2),
        "hard-four-bar-redundant": partial(joints.parallelogram, 3),
        "hard-four-bar-redundant-20": partial(joints.parallelogram, 20),
        "hard-pendulum": partial(joints.pendulum, 1),
        "hard-pendulum-copies-8": partial(joints.pendulum, 8),
        **{
            f"hard-towed-wheel-{word}": partial(joints.towed_wheel, 10, pull * WEIGHT)
            for word, pull in (("stays", 0.1), ("critical", 0.2), ("rolls", 1.0), ("slides", 5.0))
        },
        "hard-immovable-joint": joints.immovable_joint,
    },
    "rolling": {
        **{f"hard-resisting-sphere-{word}": partial(spheres.sphere_on_slope, angle) for word, angle in _ANGLES.items()},
        **{f"hard-resisting-sphere-{axes}-axes": partial(spheres.sphere_on_slope, 0.2, axes=axes) for axes in (1, 3)},
        "hard-resisting-sphere-steep": partial(spheres.sphere_on_slope, 1.0),
        "hard-slowing-sphere-stops": partial(spheres.slowing_sphere, 0.13 * WEIGHT),
        "hard-slowing-sphere-rolls-on": partial(spheres.slowing_sphere, 0.15 * WEIGHT),
        **{f"hard-resisting-spheres-{n}": partial(spheres.random_spheres_with_rolling_friction, n) for n in (30, 300)},
        "hard-resisting-spheres-3-axes": partial(spheres.random_spheres_with_rolling_friction, 40, 3),
    },
    "degenerate": {
        "hard-empty": degenerate.empty,
        "hard-one-row-closed": partial(degenerate.one_row, -1.0),
        "hard-one-row-open": partial(degenerate.one_row, 1.0),
        "hard-one-row-at-rest": partial(degenerate.one_row, 0.0),
        "hard-no-motion": degenerate.no_motion,
        "hard-no-motion-100": partial(degenerate.no_motion, 100),
        "hard-motion-1e-12": partial(degenerate.almost_no_motion, 1e-12),
        "hard-motion-1e12": partial(degenerate.almost_no_motion, 1e12),
        "hard-grazing-10": partial(degenerate.grazing, 10),
        "hard-grazing-100": partial(degenerate.grazing, 100),
        "hard-touching": degenerate.touching,
        "hard-zero-directions": degenerate.directions_without_length,
        "hard-friction-for-nothing": degenerate.friction_without_normal,
        "hard-immovable": degenerate.immovable_contact,
        "hard-immovable-100": partial(degenerate.immovable_contact, 100),
        "hard-immovable-planar": partial(degenerate.immovable_contact, 2, 2),
        "hard-immovable-spatial": partial(degenerate.immovable_contact, 2, 3),
        "hard-immovable-among-50": partial(degenerate.immovable_among, 50),
        "hard-squeezed": degenerate.squeezed,
    },
    "mixed": {
        "hard-tresca-joint": mixed.tresca_joint,
        "hard-mixed-laws": mixed.mixed_laws,
        **{f"hard-mixed-laws-{7 * copies}": partial(mixed.mixed_laws, copies) for copies in (3, 12)},
        "hard-remote-partner": mixed.remote_partner,
        **{f"hard-remote-brakes-{n}": partial(mixed.remote_brakes, n) for n in (3, 40)},
        "hard-disconnected-parts": mixed.disconnected_parts,
        "hard-disconnected-parts-few": mixed.few_parts,
        "hard-disconnected-parts-twice": mixed.disconnected_twice,
        "hard-slider-in-um-mg": partial(_in_units, supports.sliding_block, **_MILLIGRAM),
        "hard-slider-in-km-t": partial(_in_units, supports.sliding_block, **_TONNE),
        "hard-tower-in-um-mg": partial(_in_units, _tower_of_ten, **_MILLIGRAM),
        "hard-tower-in-km-t": partial(_in_units, _tower_of_ten, **_TONNE),
        "hard-mixed-laws-in-um-mg": partial(_in_units, mixed.mixed_laws, **_MILLIGRAM),
        "hard-mixed-laws-in-km-t": partial(_in_units, mixed.mixed_laws, **_TONNE, time=3600.0),
    },
    "random": {
        "hard-random-frictionless": partial(random_problem, Family(40, 1, n_dofs=30), 1),
        "hard-random-frictionless-masses": partial(
            random_problem, Family(40, 1, n_dofs=60, mass_exponent=10, density=0.1), 2
        ),
        "hard-random-planar": partial(random_problem, Family(20, 2, n_dofs=50, friction=0.25), 3),
        "hard-random-redundant": partial(random_problem, Family(30, 3, n_dofs=30, friction=0.25), 4),
        "hard-random-sparse-300": partial(random_problem, Family(300, 3, n_dofs=900, density=0.004, friction=0.5), 5),
        "hard-random-mu8": partial(random_problem, Family(20, 3, n_dofs=90, friction=8.0), 6),
        "hard-random-spectrum": partial(random_spectrum_problem, np.geomspace(1e-4, 1.0, 60), 3, 0.25, 7),
        "hard-random-rank": partial(random_spectrum_problem, _RANK, 3, 0.25, 8),
        "hard-braced": partial(random_braced_problem, Family(20, 3, n_dofs=40, friction=0.5), 9),
        "hard-braced-mu10": partial(random_braced_problem, Family(20, 3, n_dofs=40, friction=10.0), 10),
        "hard-braced-redundant-mu1": partial(random_braced_problem, Family(60, 3, n_dofs=30, friction=1.0), 11),
        **{
            f"hard-linked-{axes}-axes": partial(
                random_linked_problem,
                LinkedFamily(6, 3, n_dofs=30, states=("open", "stick", "slip"), n_joints=4, rolling_rows=axes),
                20 + axes,
            )
            for axes in (1, 2, 3)
        },
        "hard-linked-planar": partial(
            random_linked_problem, LinkedFamily(6, 2, n_dofs=20, n_joints=4, rolling_rows=1), 24
        ),
        "hard-linked-redundant": partial(
            random_linked_problem,
            LinkedFamily(20, 3, n_dofs=30, friction=0.25, n_joints=10, rolling_friction=0.125),
            25,
        ),
        "hard-float32": partial(single_precision, Family(10, 3, n_dofs=40, friction=0.25), 12),
        "hard-float32-frictionless-20": partial(single_precision, Family(20, 1, n_dofs=15), 13),
        "hard-float32-assembled-5": partial(
            single_precision, Family(5, 2, n_dofs=12, friction=0.25), 14, assembled=True
        ),
        "hard-float32-sparse-100": partial(
            single_precision, Family(100, 3, n_dofs=300, density=0.01, friction=0.5), 15
        ),
    },
}
"""Functions that create the cases, by name, for each group."""

HARD_CASES: dict[str, Maker] = dict(chain.from_iterable(group.items() for group in CASE_GROUPS.values()))
"""Functions that create the cases of the suite ``hard``, by name."""


def hard_case(name: str) -> ContactProblem:
    """Return one case of ``HARD_CASES``.

    Raises:
        KeyError: if there is no case of this name.
    """
    return HARD_CASES[name]().renamed(name, scene="hard")

"""With ``Robust``, simulate motions whose result is known from equilibrium, a theory or an empirical law.

``cards``      card houses with 2 % less and 2 % more friction than they need
``dominoes``   speed of the wave, simulated and in theory, and the energy that a row loses
``containers`` slope of boxes in a drum, and flow of boxes out of a hopper, for some seeds
``walls``      largest displacement of a wall without friction

``costs_of_accuracy.py --tables cards dominoes containers walls`` prints the tables.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from proxbench.problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from proxbench.problems.motion.equilibrium import least_friction, problem_at_rest
from proxbench.problems.motion.scenes.rigid.card_house import CardHouse
from proxbench.problems.motion.scenes.rigid.containers import Hopper, RotatingDrum
from proxbench.problems.motion.scenes.rigid.dominoes import Dominoes
from proxbench.problems.motion.scenes.rigid.walls import BrickWall
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import Step
from proxbench.solvers import Status, Stop, create

MOVED = 0.01
"""Displacement of a card [m] at which a house counts as falling."""

N_DOMINOES, MEASURED = 12, (7, 11)
"""Number of dominoes in a row, and indices of the two between which the speed of the wave is measured."""

PUSH = 12.0
"""Angular velocity of the first domino [rad/s]."""

SEEDS = (0, 1, 2)


def steps_of(scene: Any, tolerance: float, step: float, seconds: float, max_iterations: int = 50_000) -> Iterator[Step]:
    """Yield the steps of a scene with ``Robust``."""
    rule = MidpointRule(
        scene.system(),
        create("Robust"),
        Stop(tolerance, max_iterations, 60.0),
        step,
        depth=getattr(scene, "depth", None),
    )
    return rule.steps(scene.start(), round(seconds / step))


def cards(storeys: tuple[int, ...] = (1, 2, 3, 4), seconds: float = 2.0) -> Iterator[dict[str, Any]]:
    """Yield the result of each house: the time at which a card has moved by ``MOVED``, or the largest displacement."""
    for count in storeys:
        house = CardHouse(count)
        limit = least_friction(problem_at_rest(house.system(), house.start()))
        for factor in (0.98, 1.02):
            house = CardHouse(count, friction=factor * limit)
            moved, unsolved, time = 0.0, 0, 0.0
            for taken in steps_of(house, 1e-6, 1e-3, seconds):
                moved, time = max(moved, house.largest_displacement(taken.state)), taken.state.time
                unsolved += taken.status not in (Status.SOLVED, None)
                if moved > MOVED:
                    break
            outcome = "falls" if moved > MOVED else "stands"
            found = {"outcome": outcome, "time": time, "largest": moved, "unsolved": unsolved}
            yield {"storeys": count, "limit": limit, "friction": factor * limit, **found}


def dominoes(frictions: tuple[float, ...] = (0.0, 0.1, 0.2, 0.3), step: float = 5e-4) -> Iterator[dict[str, Any]]:
    """Yield the speed of the wave [m/s], and the energy lost by the end, relative to the energy at the start."""
    first, last = MEASURED
    for friction in frictions:
        row = Dominoes(n_dominoes=N_DOMINOES, push=PUSH, friction=friction)
        system, states, unsolved = row.system(), [row.start()], 0
        for taken in steps_of(row, 1e-6, step, 1.0):
            states.append(taken.state)
            unsolved += taken.status not in (Status.SOLVED, None)
            if row.front(taken.state) > row.pitch * last:
                break
        yield {
            "friction": friction,
            "speed": wave_speed(row, states, first, last),
            "theory": theoretical_speed(row, first, last),
            "theory, long row": row.limit_speed,
            "energy lost": 1.0 - energy(system, states[-1]) / energy(system, states[0]),
            "unsolved": unsolved,
        }


def wave_speed(row: Dominoes, states: Sequence[State], first: int, last: int) -> float:
    """Return the simulated speed of the wave between two dominoes [m/s]."""
    fronts = [row.front(state) for state in states]
    assert fronts[-1] > row.pitch * last
    begin, end = np.interp([row.pitch * first, row.pitch * last], fronts, [state.time for state in states])
    return row.pitch * (last - first) / float(end - begin)


def theoretical_speed(row: Dominoes, first: int, last: int) -> float:
    """Return the speed of the wave between two dominoes by the theory [m/s]."""
    return row.pitch * (last - first) / float(row.intervals[first:last].sum())


def energy(system: RigidBodies, state: State) -> float:
    assert system.potential_energy is not None
    return system.kinetic_energy(state.velocity) + system.potential_energy(state.position)


def containers(
    seeds: tuple[int, ...] = SEEDS, drum_boxes: int = 48, hopper_boxes: int = 100
) -> Iterator[dict[str, Any]]:
    """Yield the slope of boxes in a drum [degrees], and the flow out of a hopper [boxes/s], for each seed."""
    for seed in seeds:
        drum = RotatingDrum(drum_boxes, seed=seed)
        taken = list(steps_of(drum, 1e-4, drum.step_size, 1.5, 20_000))
        slopes = np.array([drum.slope(one.state) for one in taken if one.state.time > 0.5])
        found = {"least": slopes.min(), "mean": slopes.mean(), "largest": slopes.max()}
        yield {"scene": "drum", "seed": seed, **found, "law": "25 to 45", "unsolved": _unsolved(taken)}
        hopper = Hopper(hopper_boxes, seed=seed)
        taken = list(steps_of(hopper, 1e-4, hopper.step_size, 0.6, 20_000))
        through = np.array([hopper.boxes_through(one.state) for one in taken])
        counted = np.array([0.2, 0.8]) * hopper_boxes
        begin, end = np.searchsorted(through, counted)
        rate = float(np.diff(counted)[0]) / (taken[end].state.time - taken[begin].state.time)
        found = {"least": "", "mean": rate, "largest": ""}
        yield {"scene": "hopper", "seed": seed, **found, "law": hopper.flow_rate, "unsolved": _unsolved(taken)}


def _unsolved(taken: list[Step]) -> int:
    return sum(one.status not in (Status.SOLVED, None) for one in taken)


def walls(seconds: float = 2.0, step: float = 1e-3) -> Iterator[dict[str, Any]]:
    """Yield the largest displacement [m] of a wall without friction and without a ball, for each tolerance."""
    wall = BrickWall(speed=0.0, friction=0.0)
    for tolerance in (1e-6, 1e-10):
        taken = list(steps_of(wall, tolerance, step, seconds))
        moved = max(wall.largest_displacement(one.state) for one in taken)
        yield {"scene": "brick_wall", "tolerance": tolerance, "largest": moved, "unsolved": _unsolved(taken)}

"""The measurements of the cost of accuracy end as required, find known limits, and keep other tables."""

import sys
from pathlib import Path

import costs_of_accuracy
import pandas as pd
import pytest
from accuracy_charts import Quantity, draw
from costs_of_accuracy import (
    FALLEN,
    RELAXED,
    SOLVERS,
    least_thickness,
    main,
    search_thickness,
    simulate,
    thickness_ratio,
    to_tolerance,
)
from joint_errors import joint_errors, linkages
from known_motions import MOVED, cards, containers, dominoes
from lasting_contacts import count_vanishing
from pile_costs import piles
from proxbench.bench.report.charts.palette import solver_styles
from proxbench.problems.motion.scenes.rigid.arch import Arch
from proxbench.problems.motion.scenes.rigid.linkages import DEPTH
from resting_linkages import DEPTH as DEPTH_AT_REST
from resting_linkages import contact_errors, falling_chain


def test_a_simulation_ends_where_the_bound_is_exceeded() -> None:
    arch = Arch(7, 0.08)
    motion = simulate(arch, arch.largest_displacement, "NSGS", to_tolerance(1e-4), 1e-2, 5.0, FALLEN)
    assert motion.time < 1.0
    assert FALLEN < motion.largest < 10.0 * FALLEN


@pytest.mark.weekly
def test_the_least_thickness_in_motion_is_that_of_the_equilibrium() -> None:
    assert least_thickness(7) == pytest.approx(0.09570, abs=1e-5)
    ratio, motions = search_thickness(7, "Robust", to_tolerance(1e-6), 1e-2)
    assert ratio == pytest.approx(1.0, abs=3e-4)
    assert ratio == thickness_ratio(7, "Robust", to_tolerance(1e-6), 1e-2)
    assert all(motion.time == pytest.approx(1.0) for motion in motions if motion.largest <= FALLEN)


@pytest.mark.slow
def test_a_coarse_tolerance_lets_an_arch_fall_that_stands() -> None:
    arch = Arch(7, 1.02 * least_thickness(7))
    moved = [
        simulate(arch, arch.largest_displacement, "Robust", to_tolerance(tolerance), 1e-2, 1.0).largest
        for tolerance in (1e-2, 1e-4)
    ]
    assert moved[1] < 1e-2 * FALLEN < FALLEN < moved[0]


def test_a_table_that_is_measured_again_replaces_the_last_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    values = iter([1.0, 2.0, 3.0])
    for name in ("arch", "cube"):
        monkeypatch.setitem(costs_of_accuracy.TABLES, name, lambda: iter([{"ratio": next(values)}]))
    for names in (["arch", "cube"], ["arch"]):
        monkeypatch.setattr(sys, "argv", ["", "--tables", *names, "--output", str(tmp_path / "costs.csv")])
        main()
    kept = pd.read_csv(tmp_path / "costs.csv")
    assert dict(zip(kept["table"], kept["ratio"], strict=True)) == {"arch": 3.0, "cube": 2.0}


def test_work_is_time_per_simulated_second_without_motions_that_ran_out_of_time() -> None:
    rows = pd.DataFrame(
        {
            "solver": ["NSGS", "NSGS", "NSGS", "Robust"],
            "time": [2.0, 0.5, 0.5, 2.0],  # complete, fallen, out of processor time, not compared
            "largest": [1e-3, 0.2, 1e-3, 1e-3],
            "seconds": [4.0, 4.0, 40.0, 1.0],
        }
    )
    found = Quantity("drift", rows, "largest", 1e-12, 0.1, 2.0).work(solver_styles(["NSGS"]))
    assert found["work"].tolist() == [2.0, 8.0]
    assert found["cut"].tolist() == [1e-3, 0.1]


@pytest.mark.weekly
def test_the_charts_of_the_documentation_are_drawn_from_its_table(tmp_path: Path) -> None:
    docs = Path(__file__).parents[2] / "docs"
    draw(pd.read_csv(docs / "reference" / "costs-of-accuracy.csv"), tmp_path, [*SOLVERS, RELAXED])
    drawn = {file.name for file in tmp_path.glob("*.svg")}
    assert len(drawn) == 4
    assert drawn <= {file.name for file in (docs / "images").iterdir()}


def test_projection_closes_joints_at_the_cost_of_energy() -> None:
    without, closed = (joint_errors("pendulum", 0.02, 2.0, depth) for depth in (None, DEPTH))
    assert without["opening"] > 1e-5 > 1e-9 > closed["opening"]
    assert closed["|Wᵀu|"] < 1e-12 < without["|Wᵀu|"]
    assert without["energy"] < 1e-9 < closed["energy"]


@pytest.mark.slow
def test_projection_closes_the_joints_of_a_chain_that_falls_and_takes_penetration_out() -> None:
    without, closed = (contact_errors(*falling_chain(4), 0.01, 1.0, depth) for depth in (None, DEPTH_AT_REST))
    assert without["opening"] > 1e-4 > 1e-9 > closed["opening"]
    assert without["penetration"] > 1e-3 > 1.2 * DEPTH_AT_REST > closed["penetration"]


def test_contacts_of_a_stack_open_if_they_barely_overlap_and_are_not_solved_well() -> None:
    assert count_vanishing("box_stack(n_boxes=3)", 1e-2, 1e-6, 20)["vanished"] == 0
    loose = count_vanishing("box_stack(n_boxes=3, overlap=1e-9)", 1e-2, 1e-2, 20)
    assert loose["vanished"] >= loose["opened"] > 0


@pytest.mark.weekly
def test_a_pile_of_boxes_has_more_rows_than_its_rank_and_spends_part_of_its_time_on_finding_contacts() -> None:
    (found,) = piles((40,), 150, (("SORprox(relaxation=1.3)", 50),))
    assert found["contacts"] > 40
    assert 0 <= found["rows - rank"] < 3 * found["contacts"]
    assert 0.0 < found["detection"] < 1.0


@pytest.mark.slow
def test_without_projection_a_linkage_conserves_its_energy_and_with_it_the_error_is_larger() -> None:
    rows = list(linkages((10, 200), 5e-3))
    assert [(row["scene"], row["projection"]) for row in rows][:2] == [("pendulum", "without"), ("pendulum", "with")]
    assert all(row["10 steps"] <= row["200 steps"] for row in rows)
    assert rows[0]["200 steps"] < 1e-9 < rows[1]["200 steps"]


@pytest.mark.slow
def test_a_card_house_falls_below_its_limit_of_friction_and_stands_above() -> None:
    below, above = cards((1,), 0.4)
    assert (below["outcome"], above["outcome"]) == ("falls", "stands")
    assert above["largest"] < 1e-6 < MOVED < below["largest"]


@pytest.mark.weekly
def test_the_wave_of_dominoes_runs_as_fast_as_the_theory_and_loses_energy() -> None:
    (row,) = dominoes((0.2,), 1e-3)
    assert row["speed"] == pytest.approx(row["theory"], rel=0.04)
    assert 0.0 < row["energy lost"] < 1.0


@pytest.mark.weekly
def test_boxes_in_containers_are_measured_for_each_seed() -> None:
    drum, hopper = containers((1,), 12, 40)
    assert drum["least"] < drum["mean"] < drum["largest"]
    assert 0.3 * hopper["law"] < hopper["mean"] < 3.0 * hopper["law"]

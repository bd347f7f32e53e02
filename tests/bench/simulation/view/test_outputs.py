"""A stored result cannot cause files outside its folder to be replaced."""

from pathlib import Path

import pytest
from proxbench.bench.simulation.view.outputs import SimulationOutputs, read_outputs


@pytest.mark.parametrize("place", ["/etc/chart.svg", "../chart.svg", "a/../../chart.svg"])
def test_a_path_that_leads_out_of_the_folder_of_the_result_is_left_out(place: str, tmp_path: Path) -> None:
    assert read_outputs({"chart": place, "recording": None}, tmp_path / "a.npz") == SimulationOutputs()


def test_a_path_through_a_link_out_of_the_folder_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "out").symlink_to(tmp_path)
    stored = {"chart": None, "recording": "out/film.rrd"}
    assert read_outputs(stored, tmp_path / "results" / "a.npz") == SimulationOutputs()


def test_paths_beside_the_result_round_trip(tmp_path: Path) -> None:
    outputs, result = SimulationOutputs(tmp_path / "a.svg", tmp_path / "films" / "a.rrd"), tmp_path / "a.npz"
    assert read_outputs(outputs.document(result), result) == outputs

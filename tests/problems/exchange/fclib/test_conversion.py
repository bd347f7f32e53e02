"""FCLIB has the same conventions as Proxbench, and its merit function agrees with the judge."""

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from fclib_merit import natural_map
from handmade_fclib import MU, Q, W, global_data, local_data, write_data
from proxbench.problems import ContactProblem, judge, read_fclib, write_fclib
from proxbench.problems.exchange.fclib.contents import GlobalContents
from proxbench.problems.exchange.fclib.conversion import contents_of, problem_of


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("form", ["local", "global"])
def test_the_merit_of_fclib_from_its_own_arrays_is_the_natural_map_of_the_judge(
    form: str, seed: int, tmp_path: Path
) -> None:
    problem = read_fclib(write_data(tmp_path / "p.hdf5", local_data() if form == "local" else global_data()))
    impulses = np.random.default_rng(seed).normal(size=6)
    velocity = W @ impulses + Q
    merit, verdict = natural_map(velocity, impulses, MU), judge(problem, impulses)
    assert merit > 1e-3
    assert verdict.natural_map_q == pytest.approx(merit / np.linalg.norm(Q), rel=1e-12)
    largest = max(np.linalg.norm(vector) for vector in (Q, impulses, velocity))
    assert verdict.natural_map_max == pytest.approx(merit / largest, rel=1e-12)


def test_description_of_a_problem_survives_the_file(tmp_path: Path) -> None:
    info = {"title": "Boxes", "description": "Moreau, h=0.005", "math_info": "unknown"}
    data = {**local_data(), **{f"fclib_local/info/{name}": np.bytes_(text) for name, text in info.items()}}
    problem = read_fclib(write_data(tmp_path / "boxes.hdf5", data))
    assert dict(problem.provenance) == {"source": "FCLIB", "file": "boxes.hdf5", **info}
    write_fclib(problem, tmp_path / "again.hdf5")
    again = read_fclib(tmp_path / "again.hdf5")
    assert {name: again.provenance[name] for name in info} == info


@pytest.mark.parametrize("seed", range(5))
def test_a_free_motion_is_written_so_that_every_bit_of_c_is_found_again(seed: int) -> None:
    """The reader computes c = Hᵀ M⁻¹ f + w, so f and w are chosen for the rounding of this sum."""
    rng = np.random.default_rng(seed)
    directions, motion = rng.normal(size=(12, 12)), rng.normal(size=12)
    c = directions.T @ motion + 0.1 * rng.normal(size=12)
    given = (sp.csc_array(directions), 1.0 / rng.uniform(0.1, 10.0, 12), c, 0.3)
    problem = ContactProblem.from_factors(*given, free_motion=motion)
    contents = contents_of(problem)
    assert isinstance(contents, GlobalContents)
    assert contents.f.any()
    assert contents.digest == problem.digest == problem_of(contents, problem.name).digest

"""Options of external solvers are checked before their libraries are imported."""

import pytest
from proxbench.solvers import SolverError, create
from proxbench.solvers.peers import installed
from proxbench.solvers.peers.kamino_problem import TESTED_VERSION as KAMINO_VERSION
from proxbench.solvers.peers.mujoco_problem import TESTED_VERSION as MUJOCO_VERSION

VERSIONS = {"mujoco": f"{MUJOCO_VERSION}.0", "newton": f"{KAMINO_VERSION}.0"}


@pytest.mark.parametrize(
    ("name", "option", "value"),
    [
        ("PinocchioADMM", "anderson", "5"),
        ("PinocchioADMM", "anderson", 2.5),
        ("PinocchioADMM", "lanczos", "3"),
        ("PinocchioADMM", "lanczos", 2.5),
        ("PinocchioPGS", "relaxation", "1"),
        ("KaminoPADMM", "penalty", None),
        ("MuJoCo", "impedance", "0.9"),
    ],
)
def test_options_of_another_type_are_refused_by_name(
    name: str, option: str, value: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(installed, "find_spec", lambda module: module)
    monkeypatch.setattr(installed.metadata, "version", VERSIONS.__getitem__)
    with pytest.raises(SolverError, match=rf"{option} must be .*, got {value!r}"):
        create(name, **{option: value})

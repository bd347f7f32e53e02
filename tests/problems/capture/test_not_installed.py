"""Without MuJoCo, or with an untested version, one sentence tells what to install."""

import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest
from packaging.requirements import Requirement
from proxbench.problems import ProblemError, from_mujoco
from proxbench.problems.capture import mujoco_import

ROOT = Path(__file__).parents[3]


def test_a_missing_mujoco_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mujoco_import, "find_spec", lambda name: None)
    with pytest.raises(ProblemError, match=r'needs MuJoCo, which is not installed; run pip install "\.\[mujoco\]"'):
        from_mujoco(None, None)


@pytest.mark.parametrize("version", ["3.3.0", "4.1.0", "4.01.0", "5.0.0"])
def test_an_untried_version_is_refused(monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    monkeypatch.setattr(mujoco_import, "find_spec", lambda name: name)
    monkeypatch.setattr(mujoco_import.importlib, "import_module", lambda name: SimpleNamespace(__version__=version))
    with pytest.raises(
        ProblemError, match=rf"MuJoCo {version} is not supported; versions 4\.0\.x are; run pip install"
    ):
        from_mujoco(None, None)


@pytest.mark.parametrize("version", ["4.0", "4.0.0", "4.0.12"])
def test_patch_releases_are_accepted(monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    module = SimpleNamespace(__version__=version)
    monkeypatch.setattr(mujoco_import, "find_spec", lambda name: name)
    monkeypatch.setattr(mujoco_import.importlib, "import_module", lambda name: module)
    assert mujoco_import.mujoco() is module


@pytest.mark.parametrize("extra", ["mujoco", "engines"])
def test_an_extra_installs_only_accepted_versions(extra: str) -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    (allowed,) = (one.specifier for one in map(Requirement, extras[extra]) if one.name == "mujoco")
    major, minor = map(int, mujoco_import.SUPPORTED_VERSION.split("."))
    assert allowed.contains(f"{major}.{minor}.0")
    assert allowed.contains(f"{major}.{minor}.9")
    assert not allowed.contains(f"{major}.{minor + 1}.0")
    assert not allowed.contains(f"{major + 1}.0.0")

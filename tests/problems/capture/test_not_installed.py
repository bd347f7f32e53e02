"""Without MuJoCo, or with an untried version, one sentence says what to install."""

from types import SimpleNamespace

import pytest
from proxbench.problems import ProblemError, from_mujoco
from proxbench.problems.capture import installed


def test_a_missing_mujoco_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installed, "find_spec", lambda name: None)
    with pytest.raises(ProblemError, match=r'needs MuJoCo, which is not installed; run pip install "\.\[mujoco\]"'):
        from_mujoco(None, None)


@pytest.mark.parametrize("version", ["3.3.0", "5.0.0"])
def test_an_untried_version_is_refused(monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    monkeypatch.setattr(installed, "find_spec", lambda name: name)
    monkeypatch.setattr(installed.importlib, "import_module", lambda name: SimpleNamespace(__version__=version))
    with pytest.raises(ProblemError, match=rf"MuJoCo {version} is untried, 4\.x is supported; run pip install"):
        from_mujoco(None, None)

"""Offers of installed packages are those of the moment, although the search for packages is not repeated."""

from importlib import metadata
from pathlib import Path

import pytest
from proxbench.problems.exchange.plugins.offers import offers


def install(folder: Path, name: str) -> None:
    """Write the metadata of a package that offers a problem of this name."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[proxbench.problems]\n{name} = {name}:make\n")


def offered() -> set[str]:
    return {offer.name for offer in offers("problem", ())}


def test_a_package_is_offered_as_soon_as_it_is_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, "first")
    monkeypatch.syspath_prepend(tmp_path)
    assert offered() >= {"first"}
    install(tmp_path, "second")
    assert offered() >= {"first", "second"}


def test_packages_are_searched_once_while_no_folder_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, "first")
    monkeypatch.syspath_prepend(tmp_path)
    searches: list[str] = []
    search = metadata.entry_points
    monkeypatch.setattr(metadata, "entry_points", lambda: searches.append("all") or search())
    assert offered() == offered() >= {"first"}
    assert searches == ["all"]

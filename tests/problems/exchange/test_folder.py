"""A folder as a suite: every file is a member or has a reason, in the stated order and families."""

import shutil
from pathlib import Path

import pytest
from proxbench.problems import ProblemError, load, save_problem, write_fclib
from proxbench.problems.exchange.folder import FolderSuite, list_folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Five problems in two formats, one of them hidden, and other files."""
    made = tmp_path / "library"
    problem = load("hard-sticking-box")
    for place in ("boxes-2.npz", "boxes-1.npz", "deep/rocks-1.npz", ".hidden.npz"):
        save_problem(problem, made / place)
    write_fclib(problem, made / "deep" / "rocks-2.hdf5")
    (made / "notes.txt").write_text("no problem")
    return made


def described(folder: Path, text: str) -> FolderSuite:
    (folder / "suite.toml").write_text(text, encoding="utf-8")
    return list_folder(folder)


def names(suite: FolderSuite) -> list[str]:
    return [member.name for member in suite.members]


def test_files_are_members_by_name_and_families_are_folders_or_beginnings(folder: Path) -> None:
    suite = list_folder(str(folder))
    assert suite.name == "library"
    assert [(member.name, member.family) for member in suite.members] == [
        ("boxes-1", "boxes"),
        ("boxes-2", "boxes"),
        ("rocks-1", "deep"),
        ("rocks-2", "deep"),
    ]
    assert suite.broken == ()
    assert {load(member.path).n_contacts for member in suite.members} == {4}


def test_a_description_names_orders_groups_and_excludes(folder: Path) -> None:
    suite = described(
        folder,
        'name = "mine"\norder = ["deep/*", "boxes-2*"]\nexclude = ["*rocks-1*"]\n'
        '[groups]\n"all rocks" = ["deep/*"]\nboxes = ["*boxes-1.npz"]\n',
    )
    assert suite.name == "mine"
    assert names(suite) == ["rocks-2", "boxes-2", "boxes-1"]
    assert [member.family for member in suite.members] == ["all rocks", "boxes", "boxes"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name = ", "is not valid TOML"),
        ("nam = 'x'", "unknown key 'nam'; did you mean 'name'"),
        ("name = 3", "name must be a string"),
        ('name = "a\\nb"', "name must be a string without line breaks"),
        ("order = 'boxes'", "order must be a list of patterns"),
        ("order = [1]", "order must be a list of patterns"),
        ("groups = []", "groups must be a table"),
        ("[groups]\nrocks = 'deep/*'", "groups.rocks must be a list of patterns"),
        ("exclude = ['stones*']", "'stones\\*' matches no problem file"),
        ("exclude = ['*']", "there is no problem in"),
    ],
)
def test_a_description_that_makes_no_sense_gets_one_sentence(text: str, words: str, folder: Path) -> None:
    with pytest.raises(ProblemError, match=words) as caught:
        described(folder, text)
    assert str(folder) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_description_that_is_not_utf8_or_exceeds_the_size_limit_is_refused(folder: Path) -> None:
    (folder / "suite.toml").write_bytes(b"name = '\xff'")
    with pytest.raises(ProblemError, match="is not valid TOML"):
        list_folder(folder)
    (folder / "suite.toml").write_text("#" * 1_000_001)
    with pytest.raises(ProblemError, match="more than 1000000 bytes"):
        list_folder(folder)


def test_equal_names_in_two_folders_are_distinguished_and_in_one_folder_reported(folder: Path) -> None:
    shutil.copy(folder / "boxes-1.npz", folder / "deep")
    suite = list_folder(folder)
    assert names(suite) == ["boxes-1", "boxes-2", "deep-boxes-1", "rocks-1", "rocks-2"]
    write_fclib(load("hard-sticking-box"), folder / "boxes-2.hdf5")
    ((path, reason),) = list_folder(folder).broken
    assert path == folder / "boxes-2.npz"
    assert reason == f"{path} has the name of {folder / 'boxes-2.hdf5'}; rename or exclude it."


def test_missing_or_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="there is no folder"):
        list_folder(tmp_path / "nowhere")
    with pytest.raises(ProblemError, match="there is no problem in"):
        list_folder(tmp_path)

"""Files for forges and tools agree with the project: workflows, templates, citation, container."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
YAML_FILES = sorted(
    file.relative_to(ROOT).as_posix()
    for pattern in (".github/**/*.yml", ".readthedocs.yaml", ".pre-commit-config.yaml", "CITATION.cff")
    for file in ROOT.glob(pattern)
)


def content(name: str) -> Any:
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


def commands(job: dict[str, Any]) -> list[str]:
    return [step["run"] for step in job["steps"] if "run" in step]


@pytest.mark.parametrize("name", YAML_FILES)
def test_yaml_files_are_valid(name: str) -> None:
    assert isinstance(content(name), dict)


def test_the_workflow_runs_what_continuous_integration_runs_on_the_oldest_and_a_new_python() -> None:
    (job,) = content(".github/workflows/ci.yml")["jobs"].values()
    assert commands(job) == ["bash .ci/run"]
    assert (ROOT / ".ci/run").is_file()
    versions = job["strategy"]["matrix"]["python"]
    assert versions == ["3.11", "3.13"]
    assert PROJECT["project"]["requires-python"] == f">={versions[0]}"
    classifiers = PROJECT["project"]["classifiers"]
    assert all(f"Programming Language :: Python :: {version}" in classifiers for version in versions)


def test_every_folder_of_tests_that_reads_the_profile_runs_with_the_full_one_each_week() -> None:
    workflow = content(".github/workflows/weekly.yml")
    (job,) = workflow["jobs"].values()
    assert job["env"]["PROXBENCH_PROFILE"] == "full"
    assert "schedule" in workflow[True]  # YAML 1.1 reads the key `on` as a truth value
    readers = {
        path.relative_to(ROOT / "tests").parts[0]
        for path in (ROOT / "tests").glob("*/**/*.py")
        if path != Path(__file__) and re.search("PROXBENCH_PROFILE|import.*given", path.read_text(encoding="utf-8"))
    }
    assert readers <= set(job["strategy"]["matrix"]["tests"])


def test_a_release_is_built_and_checked_before_it_is_published_without_a_password() -> None:
    jobs = content(".github/workflows/release.yml")["jobs"]
    assert commands(jobs["build"])[-2:] == ["python -m build", "python -m twine check --strict dist/*"]
    assert jobs["publish"]["needs"] == "build"
    assert jobs["publish"]["permissions"] == {"id-token": "write"}
    assert "secrets." not in (ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8")


@pytest.mark.parametrize("workflow", ["ci.yml", "release.yml", "weekly.yml"])
def test_a_checkout_brings_the_tags_that_the_version_comes_from(workflow: str) -> None:
    jobs = content(f".github/workflows/{workflow}")["jobs"].values()
    checkouts = [step for job in jobs for step in job["steps"] if step.get("uses", "").startswith("actions/checkout")]
    assert [step["with"]["fetch-depth"] for step in checkouts] == [0] * len(checkouts) != []


def test_the_container_runs_the_two_commands_of_the_readme() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    block = readme.partition("```console\n")[2].partition("```")[0]
    shown = [line.removeprefix("$ ").partition("#")[0].strip() for line in block.splitlines()]
    dockerfile = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    assert re.findall(r"^RUN (.*)$", dockerfile, re.MULTILINE) == shown
    assert len(shown) == 2


def test_the_citation_has_the_licence_and_authors_of_the_project() -> None:
    citation = content("CITATION.cff")
    assert citation["license"] == PROJECT["project"]["license"]
    assert [author["name"] for author in citation["authors"]] == [one["name"] for one in PROJECT["project"]["authors"]]


def test_read_the_docs_builds_the_site_with_warnings_as_errors() -> None:
    settings = content(".readthedocs.yaml")
    assert settings["sphinx"] == {"configuration": "docs/conf.py", "fail_on_warning": True}
    assert settings["python"]["install"][0]["extra_requirements"] == ["docs"]
    assert "docs" in PROJECT["project"]["optional-dependencies"]

"""Shared: the examples in C and Rust and faulty solvers, built for the tests."""

import shutil
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from proxbench.solvers.native.structures import include_folder

HERE = Path(__file__).parent
EXAMPLES = HERE.parents[2] / "docs" / "plugins"

Build = Callable[..., Path]


@pytest.fixture(scope="session")
def build(tmp_path_factory: pytest.TempPathFactory) -> Build:
    """Return what compiles C files with options into a file of a name: ``build("libpgs.so", "pgs.c", "-shared")``."""
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler")
    folder = tmp_path_factory.mktemp("native")

    def compiled(name: str, *given: str) -> Path:
        sources = [str(EXAMPLES / one if (EXAMPLES / one).exists() else HERE / one) for one in given if one[0] != "-"]
        options = ["-std=c11", "-D_POSIX_C_SOURCE=200809L", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC"]
        options += [one for one in given if one[0] == "-"]
        command = ["cc", *options, f"-I{include_folder()}", *sources, "-o", str(folder / name), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return folder / name

    return compiled


@pytest.fixture(scope="session")
def c_library(build: Build) -> Path:
    return build("libpgs.so", "pgs.c", "-shared")


@pytest.fixture(scope="session")
def program(build: Build) -> Path:
    return build("pgs", "pgs_process.c", "pgs.c")


@pytest.fixture(scope="session")
def faulty_library(build: Build) -> Path:
    return build("libfaulty.so", "faulty.c", "-shared")


@pytest.fixture(scope="session")
def rust_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("rustc") is None:
        pytest.skip("there is no Rust compiler")
    library = tmp_path_factory.mktemp("rust") / "libpgs_rust.so"
    command = ["rustc", "-O", "-D", "warnings", "--crate-type", "cdylib", str(EXAMPLES / "pgs.rs"), "-o", str(library)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return library


@pytest.fixture(scope="session")
def faulty_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    script = tmp_path_factory.mktemp("programs") / "faulty"
    script.write_text(f"#!{sys.executable}\n" + (HERE / "faulty_program.py").read_text())
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    return script

"""Shared fixtures: the examples in C and Rust and faulty solvers, built once."""

from pathlib import Path

import native_builds
import pytest


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("native")


@pytest.fixture(scope="session")
def c_library(folder: Path) -> Path:
    return native_builds.sweeps_in_c(folder)


@pytest.fixture(scope="session")
def rust_library(folder: Path) -> Path:
    return native_builds.build_in_rust(folder / "libpgs_rust.so", native_builds.EXAMPLES / "pgs.rs")


@pytest.fixture(scope="session")
def program(folder: Path) -> Path:
    return native_builds.sweeps_as_program(folder)


@pytest.fixture(scope="session")
def faulty_library(folder: Path) -> Path:
    return native_builds.faulty_library(folder)


@pytest.fixture(scope="session")
def faulty_program(folder: Path) -> Path:
    return native_builds.faulty_program(folder)

"""Solvers in C, Rust and Python, built as libraries and programs for tests; skipped if there is no compiler."""

import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from proxbench.solvers.native.structures import include_folder

FOLDER = Path(__file__).parent
EXAMPLES = FOLDER.parents[2] / "docs" / "plugins"


def build_in_c(made: Path, *sources: Path, options: tuple[str, ...] = ()) -> Path:
    """Compile C files into a program, or into a library if it is named like one."""
    shared = ("-shared",) if made.suffix == ".so" else ()
    standard = ("-std=c11", "-D_POSIX_C_SOURCE=200809L", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC")
    paths = (f"-I{include_folder()}", *map(str, sources), "-o", str(made), "-lm")
    return _build("cc", made, *standard, *shared, *options, *paths)


def build_in_cpp(made: Path, source: Path) -> Path:
    """Compile a C++ file into a program."""
    options = ("-std=c++11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{include_folder()}")
    return _build("c++", made, *options, str(source), "-o", str(made))


def build_in_rust(made: Path, source: Path) -> Path:
    """Compile a Rust file into a library."""
    return _build("rustc", made, "-O", "-D", "warnings", "--crate-type", "cdylib", str(source), "-o", str(made))


def faulty_library(folder: Path) -> Path:
    """Build the library whose faults are chosen by its options."""
    return build_in_c(folder / "libfaulty.so", FOLDER / "faulty.c")


def sweeps_in_c(folder: Path) -> Path:
    """Build the example in C."""
    return build_in_c(folder / "libpgs.so", EXAMPLES / "pgs.c")


def sweeps_as_program(folder: Path) -> Path:
    """Build the example in C as a program."""
    return build_in_c(folder / "pgs", EXAMPLES / "pgs_process.c", EXAMPLES / "pgs.c")


def faulty_program(folder: Path) -> Path:
    """Make the program whose fault is chosen by its first argument."""
    script = folder / "faulty"
    script.write_text(f"#!{sys.executable}\n" + (FOLDER / "faulty_program.py").read_text())
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    return script


def _build(compiler: str, made: Path, *arguments: str) -> Path:
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no {compiler}")
    done = subprocess.run([compiler, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return made

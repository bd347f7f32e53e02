"""Settings take turns, the shortest times count, and the best setting is the fastest of the most accurate ones."""

import subprocess
from importlib import metadata
from pathlib import Path

import msgspec
import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.measure.trajectories.engines import run
from proxbench.bench.measure.trajectories.engines.engine import ENGINES, version_of
from proxbench.bench.measure.trajectories.engines.measurement import Measurement
from proxbench.bench.measure.trajectories.engines.run import compare_engines, read_comparison
from proxbench.bench.measure.trajectories.engines.scenes import SCENES, describe


@pytest.fixture(autouse=True)
def tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every engine seem installed in its tested version."""
    versions = {kind.distribution: f"{kind.tested_version}.1" for kind in ENGINES.values()}
    monkeypatch.setattr(metadata, "version", lambda name: versions.get(name, "1.0"))


def measurement(scene: str, engine: str, setting: str, error: float = 1.0, seconds: float = 1.0) -> Measurement:
    errors = dict.fromkeys(describe(scene).errors, error)
    return Measurement(
        scene=scene,
        engine=engine,
        setting=setting,
        time_step=1e-3,
        wall_seconds=seconds,
        processor_seconds=10.0 / seconds,  # the opposite order, which must not matter
        errors=errors,
    )


def test_engines_take_turns_and_each_round_has_all_settings() -> None:
    keys: list[tuple[str, str, str]] = []

    def measure(*key: str) -> Measurement:
        keys.append((key[0], key[1], key[2]))
        return measurement(*key)

    compare_engines(["stack"], ["pybullet", "rapier"], rounds=2, measure=measure)
    assert len(keys) == 2 * sum(len(ENGINES[engine].settings) for engine in ("pybullet", "rapier"))
    assert [engine for _, engine, _ in keys[:4]] == ["pybullet", "rapier", "pybullet", "rapier"]
    assert keys[: len(keys) // 2] == keys[len(keys) // 2 :]


def test_every_engine_takes_part_in_every_scene() -> None:
    runs = compare_engines(measure=measurement).measurements
    assert {(run.scene, run.engine) for run in runs} == {(scene, engine) for scene in SCENES for engine in ENGINES}


def test_the_shortest_time_of_all_rounds_counts() -> None:
    times = iter((3.0, *[1.0] * 4, 2.0, *[5.0] * 4))
    made = compare_engines(["stack"], ["rapier"], 2, measure=lambda *key: measurement(*key, seconds=next(times)))
    assert [run.wall_seconds for run in made.measurements] == [2.0, 1.0, 1.0, 1.0, 1.0]


def test_the_best_setting_is_the_fastest_of_the_most_accurate() -> None:
    numbers = iter([(1.0, 9.0), (1.05, 5.0), (1.2, 1.0), (3.0, 0.1), (2.0, 0.2)])
    made = compare_engines(["stack"], ["rapier"], measure=lambda *key: measurement(*key, *next(numbers)))
    best = made.best("stack", "rapier")
    assert best is not None
    assert best.wall_seconds == 5.0
    assert made.best("stack", "mujoco") is None


def test_errors_that_are_negligible_do_not_decide() -> None:
    small = describe("stack").negligible
    numbers = iter([(0.0, 2.0), (0.9 * small, 1.0), *[(2.0 * small, 0.1)] * 3])
    best = compare_engines(["stack"], ["rapier"], measure=lambda *key: measurement(*key, *next(numbers))).best(
        "stack", "rapier"
    )
    assert best is not None
    assert best.wall_seconds == 1.0


def test_an_engine_that_is_missing_or_untried_is_named_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metadata, "version", lambda name: "3.20.1")
    with pytest.raises(BenchError, match=r"pybullet 3\.20\.1 is not supported; versions 3\.2\.x are; run pip install"):
        compare_engines(["stack"], ["pybullet"], measure=measurement)

    def missing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", missing)
    with pytest.raises(BenchError, match=r"the engine rapier is not installed; run pip install .*\[engines\]"):
        version_of("rapier")


def test_earlier_runs_are_kept_and_only_the_others_run(tmp_path: Path) -> None:
    first = compare_engines(["stack"], ["rapier"], measure=lambda *key: measurement(*key, seconds=3.0))
    failed = msgspec.structs.replace(first.measurements[1], failure="no memory")
    file = tmp_path / "engines.json"
    stored = msgspec.structs.replace(first, measurements=(first.measurements[0], failed, *first.measurements[3:]))
    file.write_bytes(msgspec.json.encode(stored))
    keys: list[str] = []

    def measure(*key: str) -> Measurement:
        keys.append(key[2])
        return measurement(key[0], key[1], key[2])

    again = compare_engines(["stack"], ["rapier"], measure=measure, earlier=read_comparison(file))
    settings = [setting.name for setting in ENGINES["rapier"].settings]
    assert keys == settings[1:3]
    times = {run.setting: run.wall_seconds for run in again.measurements}
    assert times == {name: 1.0 if name in keys else 3.0 for name in settings}


def test_the_largest_load_of_earlier_runs_is_kept() -> None:
    first = compare_engines(["stack"], ["rapier"], measure=measurement)
    for load in ((1e3, 0.0), (0.0, 1e3)):
        loaded = msgspec.structs.replace(first, load=load)
        assert compare_engines(["stack"], ["rapier"], measure=measurement, earlier=loaded).load[0] == 1e3


def test_missing_settings_run_as_often_as_earlier_ones() -> None:
    first = compare_engines(["stack"], ["rapier"], rounds=3, measure=measurement)
    left = msgspec.structs.replace(first, measurements=first.measurements[2:])
    keys: list[str] = []

    def measure(*key: str) -> Measurement:
        keys.append(key[2])
        return measurement(key[0], key[1], key[2])

    again = compare_engines(["stack"], ["rapier"], measure=measure, earlier=left)
    assert keys == 3 * [setting.name for setting in ENGINES["rapier"].settings[:2]]
    assert again.rounds == 3
    with pytest.raises(BenchError, match="the earlier runs have 3 rounds, not 2; omit `rounds`"):
        compare_engines(["stack"], ["rapier"], rounds=2, measure=measure, earlier=left)


@pytest.mark.parametrize(("n_runs", "rounds"), [(3, 1), (7, 1), (12, 2)])
def test_an_interrupted_comparison_has_the_rounds_that_all_its_settings_have(n_runs: int, rounds: int) -> None:
    left = iter(range(n_runs))

    def measure(*key: str) -> Measurement:
        if next(left, None) is None:
            raise KeyboardInterrupt
        return measurement(key[0], key[1], key[2])

    made = compare_engines(["stack"], ["rapier"], rounds=3, measure=measure)
    assert made.is_interrupted
    assert made.rounds == rounds


@pytest.mark.parametrize(
    ("where", "key", "name"),
    [
        ("versions", "rapier", "rapier"),
        ("machine", "processor", "processor"),
        ("machine", "source", "the source of Proxbench with the digest"),
    ],
)
def test_runs_of_another_version_source_or_processor_are_not_mixed(where: str, key: str, name: str) -> None:
    first = compare_engines(["stack"], ["rapier"], measure=measurement)
    other = msgspec.structs.replace(first, **{where: getattr(first, where) | {key: "0.36.0"}})
    with pytest.raises(BenchError, match=rf"the earlier runs used {name} 0\.36\.0, not .+; measure all of them"):
        compare_engines(["stack"], ["rapier"], measure=measurement, earlier=other)


def test_a_file_that_is_no_comparison_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "engines.json"
    with pytest.raises(BenchError, match=r"cannot read the result .*engines\.json: No such file or directory; name a"):
        read_comparison(file)
    file.write_text("{}")
    with pytest.raises(
        BenchError, match=r"is not a result of proxbench engines: .*missing required field.*; name a \.json file"
    ):
        read_comparison(file)


def test_unknown_names_are_named_with_the_nearest() -> None:
    with pytest.raises(BenchError, match="there is no engine scene 'stak'; did you mean 'stack'"):
        compare_engines(["stak"], measure=measurement)
    with pytest.raises(BenchError, match="there is no engine 'rapid'"):
        compare_engines(["stack"], ["rapid"], measure=measurement)


def test_a_run_that_fails_keeps_its_last_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "msgspec.py").write_text("raise RuntimeError('no memory')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert run._measure_in_subprocess("thrown-cube", "proxbench", "1e-2").failure == "RuntimeError: no memory"
    monkeypatch.setattr(run, "RUN_SECONDS", 0.01)
    assert run._measure_in_subprocess("stack", "rapier", "default").failure == "took longer than 0 s"


def test_what_a_library_prints_before_a_measurement_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    found = measurement("stack", "rapier", "default")
    printed = "welcome to the engine\n" + msgspec.json.encode(found).decode() + "\n"
    ended = subprocess.CompletedProcess([], 0, stdout=printed, stderr="")
    monkeypatch.setattr(subprocess, "run", lambda *_, **options: ended)
    assert run._measure_in_subprocess("stack", "rapier", "default") == found

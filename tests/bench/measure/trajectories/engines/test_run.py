"""Settings run in turn, the shortest times count, and the best setting is the fastest of the most accurate ones."""

from importlib import metadata

import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.measure.trajectories.engines import run
from proxbench.bench.measure.trajectories.engines.engine import ENGINES, version_of
from proxbench.bench.measure.trajectories.engines.measurement import Measurement
from proxbench.bench.measure.trajectories.engines.run import compare_engines
from proxbench.bench.measure.trajectories.engines.scenes import describe


@pytest.fixture(autouse=True)
def tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every engine seem installed in the version that was tried."""
    versions = {kind.distribution: f"{kind.tried}.1" for kind in ENGINES.values()}
    monkeypatch.setattr(metadata, "version", lambda name: versions.get(name, "1.0"))


def measurement(scene: str, engine: str, setting: str, error: float = 1.0, seconds: float = 1.0) -> Measurement:
    errors = dict.fromkeys(describe(scene).errors, error)
    return Measurement(
        scene=scene,
        engine=engine,
        setting=setting,
        time_step=1e-3,
        wall_seconds=seconds,
        processor_seconds=10.0 / seconds,  # the opposite order, which must decide nothing
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


def test_proxbench_takes_part_where_all_bodies_are_balls() -> None:
    scenes = {run.scene for run in compare_engines((), ["proxbench"], measure=measurement).measurements}
    assert scenes == {"pile", "funnel"}


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
    with pytest.raises(BenchError, match=r"pybullet 3\.20\.1 is untried, 3\.2\.x is supported; run pip install"):
        compare_engines(["stack"], ["pybullet"], measure=measurement)

    def missing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", missing)
    with pytest.raises(BenchError, match=r"the engine rapier is not installed; run pip install .*\[engines\]"):
        version_of("rapier")


def test_unknown_names_are_named_with_the_nearest() -> None:
    with pytest.raises(BenchError, match="unknown scene 'stak' of engines; did you mean 'stack'"):
        compare_engines(["stak"], measure=measurement)
    with pytest.raises(BenchError, match="unknown engine 'rapid'"):
        compare_engines(["stack"], ["rapid"], measure=measurement)


def test_a_run_that_fails_keeps_its_last_line(monkeypatch: pytest.MonkeyPatch) -> None:
    failed = run._in_own_process("thrown-cube", "proxbench", "1e-2")  # which has no cubes
    assert "cannot read 'None' as a scene" in failed.failure
    monkeypatch.setattr(run, "RUN_SECONDS", 0.01)
    assert run._in_own_process("stack", "rapier", "default").failure == "took longer than 0 s"

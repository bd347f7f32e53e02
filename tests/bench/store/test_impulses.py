"""Stored impulses equal the judged ones to the bit; of several answers, the worst is stored."""

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from msgspec.structs import replace
from proxbench.bench.measure.points import joined, keep_finest_impulses
from proxbench.bench.store.conversion import decode_record, encode_record
from proxbench.bench.store.impulses import Impulses, worst
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import CaseRecord, Point
from proxbench.problems import ContactProblem, judge
from stored_cases import case_record, measured_in, timed_round


def kept(residual: float | None, model_residual: float | None = None, packed: bytes = b"") -> Impulses:
    return Impulses(residual=residual, model_residual=model_residual, packed=packed)


def point(*impulses: Impulses, number: int = 0) -> Point:
    measured = replace(measured_in([timed_round(number, 1.0)]), impulses=list(impulses))
    return Point(tolerance=1e-3, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)


@given(arrays(np.float64, st.integers(0, 50), elements=st.floats(width=64)))
def test_impulses_are_kept_to_the_bit_also_in_a_file(impulses: np.ndarray) -> None:  # type: ignore[type-arg]
    problem = ContactProblem.from_delassus(np.eye(3), (-1.0, 0.0, 0.0), 0.3)
    verdict = judge(problem, np.zeros(3))
    made = Impulses.of(impulses, verdict, verdict)
    case = case_record(points=[point(made)])
    (again,) = decode_record(encode_record(case), CaseRecord, "it", "").points
    assert again.measured is not None
    (read,) = again.measured.impulses
    assert read == made
    assert read.unpacked(len(impulses)).tobytes() == impulses.tobytes()


@pytest.mark.parametrize(
    "packed", [b"", b"x", zlib.compress(bytes(24)), zlib.compress(bytes(40)), zlib.compress(bytes(32))[:-1]]
)
def test_arrays_of_wrong_length_are_rejected(packed: bytes) -> None:
    with pytest.raises(ValueError, match=r"data are damaged|expected 4 numbers|the data exceed 32 bytes"):
        kept(0.0, packed=packed).unpacked(4)


def test_decompression_is_limited_to_the_expected_size(monkeypatch: pytest.MonkeyPatch) -> None:
    bomb = kept(0.0, packed=zlib.compress(bytes(2**26), 9))
    import tracemalloc

    tracemalloc.start()
    with pytest.raises(ValueError, match="the data exceed 32 bytes"):
        bomb.unpacked(4)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 2**22


def test_the_worst_answer_under_each_law_is_kept() -> None:
    coulomb, model, good = kept(0.5, 1e-9, b"a"), kept(0.1, 1e-3, b"b"), kept(1e-9, 1e-9, b"c")
    assert worst([good, coulomb, model]) == [coulomb, model]
    assert worst([good, kept(None, None)]) == [kept(None, None)]
    assert worst([good, good]) == [good]
    assert worst([]) == []


def test_worst_answer_of_all_passes_is_kept() -> None:
    bad, good = kept(1e-3, 1e-3, b"a"), kept(1e-9, 1e-9, b"b")
    for first, second in ((bad, good), (good, bad)):
        found = joined(point(first), point(second, number=1)).measured
        assert found is not None
        assert found.impulses == [bad]
    unknown = joined(point(), point(good, number=1)).measured
    assert unknown is not None
    assert unknown.impulses == []


def test_only_the_finest_measured_point_keeps_impulses() -> None:
    not_attempted = Point(tolerance=1e-4, outcome=Outcome.NOT_ATTEMPTED, status="", reason="")
    points = keep_finest_impulses([point(kept(0.1)), point(kept(0.2)), not_attempted])
    assert [one.measured and len(one.measured.impulses) for one in points] == [0, 1, None]

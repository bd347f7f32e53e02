"""Damaged files are refused with one sentence."""

from typing import Any

import msgspec
import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.store.conversion import FORMAT, checksum, decode_record
from proxbench.bench.store.records import CaseRecord


def nested(depth: int) -> dict[str, Any]:
    """Return an object that contains ``depth`` objects, one within another."""
    inner: dict[str, Any] = {}
    for _ in range(depth):
        inner = {"inner": inner}
    return inner


@pytest.mark.parametrize("depth", [100, 900])
def test_an_invalid_object_at_any_nesting_depth_is_refused(depth: int) -> None:
    body = {"format": FORMAT, "x": nested(depth)}
    data = msgspec.json.encode({**body, "checksum": checksum(body)})
    with pytest.raises(
        BenchError, match=r"^case\.json is damaged \(the value of its \w+ is invalid\); measure it again\.$"
    ):
        decode_record(data, CaseRecord, "case.json", "measure it again")

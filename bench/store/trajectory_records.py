"""What a run over trajectories stores of its problems and of what it compares on them."""

from typing import Annotated, Literal

from msgspec import Meta

from .fields import Count, Number, Positive, Record, Tolerance


class MethodRecord(Record, frozen=True, kw_only=True):
    """A stepper with a solver.

    Attributes:
        name: of both.
        values: the ladder of steps [s] or tolerances.
        tolerance: of the solver where the stepper varies.
        max_iterations: of the solver in one solve.
        start: what each solve starts from.
    """

    name: str
    values: Annotated[list[Tolerance], Meta(min_length=1)]
    tolerance: Tolerance
    max_iterations: Count
    start: str


class KnownRecord(Record, frozen=True, kw_only=True):
    """What one member of the reference of a trajectory came to, by name; none with the reason if it failed."""

    member: Number
    values: dict[str, Number]
    failure: str = ""


class TrajectoryRecord(Record, frozen=True, kw_only=True):
    """A problem for steppers with solvers.

    Attributes:
        name: the scene with its options.
        duration: simulated time [s].
        members: seeds of the scene where aggregates are compared, else factors on steps or tolerances.
        error: how it is computed.
        reference: what simulates the reference, with one value; None where the end of the motion is known otherwise.
        known: the reference, or the known end, as far as it is generated.
        scale: what differences from a known end are related to.
        way: longest way of a coordinate from the start to the known end [m]; None where it is not known.

    Raises:
        ValueError: if members of the reference differ in what is known of them.
    """

    name: str
    duration: Positive
    members: Annotated[list[Number], Meta(min_length=1)]
    error: Literal["limit cycle", "end position", "aggregates"]
    reference: MethodRecord | None = None
    known: list[KnownRecord] = []
    scale: Positive = 1.0
    way: Number | None = None

    def __post_init__(self) -> None:
        if len({tuple(sorted(one.values)) for one in self.known if not one.failure}) > 1:
            raise ValueError("its reference has other values for each member")

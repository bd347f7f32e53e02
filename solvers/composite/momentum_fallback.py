"""MomentumFallback: sweeps over the factors with momentum, and with more of it where that does not do.

Moderate momentum is the fastest way to the usual accuracy on hundreds of contacts and more. While a pile settles a rare
step stays on a plateau, which long momentum leads off; the three further parts were chosen because they solve most of
the steps that the first one leaves. What none of them solves is left to ``Robust``.
"""

from dataclasses import dataclass

from ..prox.sorprox import SORprox
from .fallback import Fallback
from .robust import Robust
from .sweeping import FIRST

FURTHER = ((1.0, 0.97), (1.2, 0.985), (1.0, 0.985))
"""Relaxation and momentum of the parts after the first."""


@dataclass(frozen=True, init=False)
class MomentumFallback(Fallback):
    """A ``Fallback`` of SORprox over the factors with momentum 0.8, then 0.97, 0.985 and 0.985 at other relaxations.

    The last part is ``Robust``, the only one where the problem holds G alone. What ``proxbench simulate`` takes for
    scenes with many contacts.
    """

    def __init__(self) -> None:
        super().__init__(
            *(
                SORprox(relaxation=relaxation, form="factors", momentum=momentum)
                for relaxation, momentum in (FIRST, *FURTHER)
            ),
            Robust(),
        )

    @property
    def name(self) -> str:
        """Class name."""
        return type(self).__name__

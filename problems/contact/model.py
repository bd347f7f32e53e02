"""The mathematical model that a solver solves, which need not be Coulomb's."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from ..errors import ProblemError

ModelKind = Literal["coulomb", "convex", "pyramid", "frictionless", "engine"]


@dataclass(frozen=True)
class Model:
    """A contact model; ``sides`` is the number of sides of a pyramid, 0 for the other kinds.

    * ``Model.COULOMB``: unilateral contact with Coulomb friction, the reference model.
    * ``Model.CONVEX``: the associated law, −ξ ∈ N_K(Λ) with K the friction cone; a sliding contact dilates.
    * ``Model.pyramid(k)``: Coulomb friction with the disc replaced by the inscribed regular k-gon.
    * ``Model.FRICTIONLESS``: no friction impulses.
    * ``Model.ENGINE``: the model that an engine solved in a captured step, with its regularisation; the convex model
      for all other problems.
    """

    kind: ModelKind
    sides: int = 0

    COULOMB: ClassVar["Model"]
    CONVEX: ClassVar["Model"]
    FRICTIONLESS: ClassVar["Model"]
    ENGINE: ClassVar["Model"]

    @staticmethod
    def pyramid(sides: int) -> "Model":
        """Return the pyramid model of ``sides`` sides.

        Raises:
            ProblemError: if ``sides`` is not a whole number of at least 3.
        """
        if not isinstance(sides, int | np.integer) or sides < 3:
            raise ProblemError(f"a friction pyramid needs a whole number of at least 3 sides, got {sides!r}.")
        return Model("pyramid", int(sides))

    @staticmethod
    def from_text(text: str) -> "Model":
        """Return the model whose ``str`` is ``text``.

        Raises:
            ProblemError: if there is no such model.
        """
        kind, _, sides = text.removesuffix(")").partition("(")
        if kind == "pyramid" and sides.isdecimal():
            return Model.pyramid(int(sides))
        for model in (Model.COULOMB, Model.CONVEX, Model.FRICTIONLESS, Model.ENGINE):
            if text == str(model):
                return model
        raise ProblemError(f"there is no contact model {text!r:.60}.")

    def __str__(self) -> str:
        return f"{self.kind}({self.sides})" if self.kind == "pyramid" else self.kind


Model.COULOMB = Model("coulomb")
Model.CONVEX = Model("convex")
Model.FRICTIONLESS = Model("frictionless")
Model.ENGINE = Model("engine")

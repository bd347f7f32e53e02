"""The live summary of a simulation with variable steps."""

from typing import Any

from ..simulation.live import LiveSummary


class VariableLive(LiveSummary):
    """Shows how far it is, how long the steps are, and what was found; see ``LiveSummary``."""

    def _share(self, simulation: Any) -> float:
        plan = simulation.plan
        return float((simulation.state.time - plan.scene.start.time) / plan.duration)

    def _lines(self, simulation: Any, now: float) -> tuple[str, str]:
        plan, last = simulation.plan, simulation.last_row
        first = f"{plan.scene.name}  {last['time']:.6f} of {plan.until:g} s  step {simulation.n_steps}"
        self._unsolved = int(last["residual"] > plan.tolerance)
        return first, (
            f"step size {last['length']:.1e} s  closed contacts {last['contacts']:.0f}  switching points "
            f"{simulation.n_switches}  residual {last['residual']:.0e}"
        )

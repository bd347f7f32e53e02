"""Small models for captures."""

from typing import Any

import numpy as np
import pytest
from proxbench.problems.capture import rows

STACK = """
<mujoco model="stack">
<option cone="{cone}" integrator="{integrator}" solver="{solver}" iterations="100" tolerance="0"/>
<worldbody><geom name="floor" type="plane" size="5 5 0.1" friction="0.5"/>
<body pos="0 0 0.099"><freejoint/><geom name="a" type="box" size="0.1 0.1 0.1" mass="1" friction="0.5"/></body>
<body pos="0 0 0.298"><freejoint/><geom name="b" type="box" size="0.1 0.1 0.1" mass="10" friction="0.5"/></body>
<body pos="0 0 0.497"><freejoint/><geom name="c" type="box" size="0.1 0.1 0.1" mass="100" friction="0.5"/></body>
</worldbody></mujoco>"""
"""Three boxes of 1, 10 and 100 kg."""

CUBE = """
<mujoco model="cube"><option cone="elliptic" iterations="100" tolerance="0"/>
<worldbody><geom name="floor" type="plane" size="10 10 0.1" friction="0.5"/>
<body pos="0 0 0.1"><freejoint/><geom name="cube" type="box" size="0.1 0.1 0.1" friction="0.5"/></body>
</worldbody><keyframe><key name="thrown" qvel="6 0 0 0 0 0"/></keyframe></mujoco>"""
"""A cube that slides away at 6 m/s."""

EVERYTHING = """
<mujoco model="everything">
<option cone="{cone}" integrator="{integrator}" solver="{solver}" iterations="100" tolerance="0" jacobian="{jacobian}"/>
<worldbody><geom name="floor" type="plane" size="5 5 0.1" friction="0.5 0.01 0.002" condim="6"/>
<body pos="0 0 0.099"><freejoint/><geom name="box" type="box" size="0.1 0.1 0.1" condim="4"/></body>
<body pos="0.5 0 0.3"><joint name="hinge" type="hinge" axis="0 1 0" damping="0.3" stiffness="2" range="-20 20"
  frictionloss="0.1"/><geom name="arm" type="capsule" fromto="0 0 0 0 0 -0.33" size="0.03"/>
<body pos="0 0 -0.2"><joint name="ball" type="ball" damping="0.05" range="0 10"/>
  <geom name="hand" type="capsule" fromto="0 0 0 0.2 0 0" size="0.03"/></body></body>
<body name="left" pos="2 0 0.5"><freejoint/><geom size="0.1"/></body>
<body name="right" pos="2.3 0 0.5"><freejoint/><geom size="0.1"/></body></worldbody>
<tendon><fixed name="tendon" damping="0.1" stiffness="3" range="-0.1 0.1" frictionloss="0.2">
  <joint joint="hinge" coef="1"/></fixed></tendon>
<equality><weld name="weld" body1="left" body2="right"/></equality>
<actuator><position joint="hinge" kp="5" kv="0.2" ctrlrange="-1 1"/></actuator></mujoco>"""
"""A model with every kind of constraint row, dampers, springs and an actuator."""

WELDED = """
<mujoco model="welded"><worldbody><body name="left"><freejoint/><geom size="0.1"/></body>
<body name="right" pos="1 0 0"><freejoint/><geom size="0.1"/></body></worldbody>
<equality><weld name="weld" body1="left" body2="right"/></equality></mujoco>"""
"""Two balls that fall, welded together."""


def refuse_first_rows(monkeypatch: pytest.MonkeyPatch, count: int = 6) -> None:
    """Let the first rows of every step move nothing; MuJoCo itself omits such rows."""
    norms = rows._norms

    def without_first(given: Any, jacobian: Any) -> Any:
        return norms(given, jacobian) * (np.arange(len(given)) >= count)

    monkeypatch.setattr(rows, "_norms", without_first)


def moving(text: str, steps: int = 100) -> tuple[Any, Any]:
    """Return a model and its data after some steps from a random velocity."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qvel[:] = 0.1 * np.random.default_rng(0).standard_normal(model.nv)
    data.ctrl[:] = 0.3
    for _ in range(steps):
        mujoco.mj_step(model, data)
    return model, data

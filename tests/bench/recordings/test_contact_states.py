"""Contact states (open, stick, slip) follow from the impulses."""

import numpy as np
from proxbench.bench.recordings.contact_states import ContactState, contact_states, count_states
from proxbench.problems import load
from proxbench.problems.contact.blocks import layout_of
from proxbench.problems.contact.laws import Laws


def test_states_follow_from_the_share_of_the_friction_bound() -> None:
    layout = layout_of(Laws.contacts(0.5, 3, 4))
    lanes = np.array([[0.0, 0.0, 0.0], [2.0, 0.6, 0.0], [2.0, 0.6, 0.8], [1e-9, 0.0, 0.0]])
    states = contact_states(layout, lanes)
    expected = [ContactState.OPEN, ContactState.STICK, ContactState.SLIP, ContactState.OPEN]
    assert states.tolist() == expected
    assert count_states(states).tolist() == [2, 1, 1]


def test_a_closed_frictionless_contact_slips_and_a_nan_impulse_is_open() -> None:
    layout = layout_of(Laws.contacts(0.0, 1, 3))
    assert contact_states(layout, np.array([[1.0], [0.0], [np.nan]])).tolist() == [2, 0, 0]


def test_a_joint_with_dry_friction_is_never_open() -> None:
    problem = load("hard-tresca-joint")
    assert problem.answer is not None
    states = contact_states(problem.layout, problem.layout.pad(problem.answer.impulses[0]))
    assert states.tolist() == [ContactState.SLIP, ContactState.STICK, ContactState.SLIP]


def test_joints_stick_and_rolling_does_not_count_as_slip() -> None:
    laws = Laws.concatenate([Laws.joints(2), Laws.contacts([0.5], 3, 1).with_rolling(0.1, 2)])
    lanes = np.array([[-3.0, 0, 0, 0, 0], [0.0, 0, 0, 0, 0], [2.0, 0.3, 0.0, 0.2, 0.0]])
    assert contact_states(layout_of(laws), lanes).tolist() == [ContactState.STICK] * 3
    assert contact_states(layout_of(laws), lanes[:, :3]).tolist() == [ContactState.STICK] * 3

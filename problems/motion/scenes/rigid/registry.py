"""Scenes of rigid bodies, as entries of the registry."""

from collections.abc import Mapping

from ..known_motions import scene_kind
from ..scene import SceneKind
from .arch import Arch
from .boxes import BoxOnIncline, BoxStack, ThrownBox, TippingBox
from .card_house import CardHouse
from .containers import Hopper, RotatingDrum
from .dominoes import Dominoes
from .linkages import BallOnChain, Chain, FourBar, Pendulum
from .rolling import RollingCylinder, RollingSphere
from .spinning_top import SpinningTop
from .walls import BrickWall

RIGID_SCENES: Mapping[str, SceneKind] = {
    "box_on_incline": scene_kind(BoxOnIncline, "a box that slides, stops or stays on an incline"),
    "tipping_box": scene_kind(
        TippingBox, "a box on an incline that tips over its lower edge or stays", 0.3, has_few_contacts=False
    ),
    "thrown_box": scene_kind(ThrownBox, "a box thrown along level ground, which slides to a stop", 1.5),
    "rolling_sphere": scene_kind(
        RollingSphere, "a sphere that rolls to rest under rolling resistance", 2.0, has_few_contacts=False
    ),
    "rolling_cylinder": scene_kind(
        RollingCylinder, "a cylinder that rolls to rest under rolling resistance", 2.0, has_few_contacts=False
    ),
    "box_stack": scene_kind(BoxStack, "boxes at rest on top of each other", 10.0, has_few_contacts=False),
    "arch": scene_kind(Arch, "a masonry arch, which stands if it is thick enough", has_few_contacts=False),
    "card_house": scene_kind(CardHouse, "a house of cards, which stands if friction suffices", has_few_contacts=False),
    "spinning_top": scene_kind(SpinningTop, "a top on its tip that precesses steadily", has_few_contacts=False),
    "dominoes": scene_kind(Dominoes, "a wave of falling dominoes", 0.7, has_few_contacts=False),
    "brick_wall": scene_kind(BrickWall, "a wall of bricks struck by a ball", 0.5, has_few_contacts=False),
    "drum": scene_kind(RotatingDrum, "boxes in a rotating drum", 1.5, has_few_contacts=False),
    "hopper": scene_kind(Hopper, "boxes flowing through a slot", 2.0, has_few_contacts=False),
    "pendulum": scene_kind(Pendulum, "a rod that swings on a hinge", has_few_contacts=False),
    "chain": scene_kind(Chain, "rods on ball joints that swing", has_few_contacts=False),
    "ball_on_chain": scene_kind(BallOnChain, "a heavy ball that swings on a light chain", has_few_contacts=False),
    "four_bar": scene_kind(FourBar, "a crank, a coupler and a rocker on hinges", has_few_contacts=False),
}
"""Scenes of rigid bodies by name."""

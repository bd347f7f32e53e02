"""Draw ``rigid-scenes.png``, a frame of each scene of rigid bodies: ``python docs/images/rigid_scenes.py``.

Needs Pillow and a Vulkan driver, and takes five minutes.
"""

import subprocess
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw, ImageOps

FRAMES = {
    "box_on_incline": 0.4,
    "tipping_box": 0.25,
    "thrown_box": 0.2,
    "rolling_sphere": 0.2,
    "rolling_cylinder": 0.2,
    "box_stack": 0.1,
    "arch": 0.1,
    "card_house": 0.1,
    "spinning_top": 0.3,
    "dominoes": 0.6,
    "brick_wall": 0.2,
    "drum": 0.3,
    "hopper": 0.4,
    "pendulum": 0.3,
    "chain": 0.3,
    "ball_on_chain": 0.3,
    "four_bar": 0.3,
}
"""Time of the frame of each scene [s]."""

STEP = 2e-3
STIFF_STEPS = {"ball_on_chain": 2e-4}
"""Steps [s] of scenes whose joints do not close with ``STEP``."""

STACKED, SIDE_BY_SIDE = (0, 30, 1066, 499), (0, 30, 532, 999)
"""Box around the view of the bodies in a still of 1600 by 1000 pixels, above or beside that of the forces: left, top,
right, bottom."""

TITLE_BAR, BELOW = (1050, 10), (1050, 510)
"""Pixels in the title bar of a view, and in that of the lower view if views are stacked."""

COLUMNS, SIZE, GAP = 6, (240, 168), 4


def draw(scene: str, seconds: float, folder: Path) -> Image.Image:
    """Simulate a scene, and return the view of its bodies at the end."""
    motion, still = folder / f"{scene}.npz", folder / f"{scene}.png"
    stepper = f"Moreau(step={STIFF_STEPS.get(scene, STEP)})"
    method = ("--stepper", stepper, "--solver", "Robust", "--tolerance", "1e-6")
    subprocess.run(
        ["proxbench", "simulate", scene, *method, "--duration", str(seconds), "--output", motion, "--quiet"], check=True
    )
    subprocess.run(["proxbench", "record", motion, "--still", still, "--quiet"], check=True)
    whole = Image.open(still).convert("RGB")
    is_stacked = whole.getpixel(TITLE_BAR) == whole.getpixel(BELOW)
    view = whole.crop(STACKED if is_stacked else SIDE_BY_SIDE)
    view = ImageOps.pad(view, SIZE, Image.Resampling.LANCZOS, color=view.getpixel((5, 5)))
    ImageDraw.Draw(view).text((6, 3), scene, fill="white", font_size=12)
    return view


def main() -> None:
    """Join the views of all scenes."""
    width, height = SIZE[0] + GAP, SIZE[1] + GAP
    rows = -(-len(FRAMES) // COLUMNS)
    picture = Image.new("RGB", (COLUMNS * width - GAP, rows * height - GAP), "white")
    with tempfile.TemporaryDirectory() as folder:
        for place, (scene, seconds) in enumerate(FRAMES.items()):
            row, column = divmod(place, COLUMNS)
            picture.paste(draw(scene, seconds, Path(folder)), (column * width, row * height))
    picture.save(Path(__file__).with_name("rigid-scenes.png"), optimize=True)


if __name__ == "__main__":
    main()

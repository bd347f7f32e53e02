"""Links that lead out of a folder: results may come from elsewhere, and nothing is written through them."""

import os
from itertools import accumulate
from pathlib import Path

from ..errors import BenchError


def refuse_links_out(place: Path, folder: Path) -> None:
    """Find out whether a link on the way from a folder to a place in it, or below that place, leads out of the folder.

    Results may come from elsewhere: showing them must not replace files wherever their links say.

    Raises:
        BenchError: if one does.
    """
    inside = os.path.realpath(folder)
    way = list(accumulate(place.relative_to(folder).parts, Path.joinpath, initial=folder))[1:]
    below = [Path(top, name) for top, folders, files in os.walk(place) for name in (*folders, *files)]
    for link in (*way, *below):
        target = os.path.realpath(link)
        if os.path.islink(link) and not Path(target).is_relative_to(inside):
            raise BenchError(
                f"{link} is a link out of {folder}, to {target}, and nothing is written through it; "
                "remove it, or name another place."
            )

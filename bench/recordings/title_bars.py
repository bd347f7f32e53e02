"""Layouts without the viewer's own controls: its panels, and the buttons on the title bar of each view.

A blueprint can hide panels and whole title bars, but not single buttons, and curves and solvers need their titles.
Buttons are therefore painted over; the shares in the blueprint determine their positions.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from PIL import Image

Blueprint = Mapping[str, Mapping[str, Mapping[str, Any]]]
"""Fields by archetype by entity, as the viewer reads and writes them."""

Box = tuple[float, float, float, float]
"""Left, top, right and bottom edge [pixels]."""

TOP_BAR = 36
"""Height of the bar above all views, which stays empty when the panels are hidden [pixels]."""

TITLE_BAR, ICON, BUTTONS = 28, 26, 96
"""Height of a title bar, and widths of the icon before its title and of the buttons at its end [pixels]."""

MARGIN = 10
"""Distance from the left edge of a view to its title [pixels]."""

GAP = 1.0
"""Distance between neighbouring views [pixels]."""

LEGEND_SHARE = 0.25
"""Space for a legend relative to the length of its curves."""

PANELS = {
    "/top_panel": "PanelBlueprint",
    "/blueprint_panel": "PanelBlueprint",
    "/selection_panel": "PanelBlueprint",
    "/time_panel": "TimePanelBlueprint",
}
"""Entities of the viewer's own panels in a blueprint, with their archetypes."""


def without_panels(blueprint: Blueprint) -> Blueprint:
    """Return a blueprint without the viewer's own panels, whose buttons do not belong to the recording."""
    hidden = {
        panel: {archetype: {**blueprint.get(panel, {}).get(archetype, {}), "state": "Hidden"}}
        for panel, archetype in PANELS.items()
    }
    return {**blueprint, **hidden}


def with_whole_curves(blueprint: Blueprint, times: tuple[int, int]) -> Blueprint:
    """Return a blueprint whose plots show the curves between two times, with space for legends."""
    start, end = times
    view_range = {"start": {"Absolute": start}, "end": {"Absolute": end + math.ceil(LEGEND_SHARE * (end - start))}}
    plots = [view for view in blueprint if _kind(blueprint, view) == "TimeSeries"]
    return {**blueprint, **{f"{view}/TimeAxis": {"TimeAxis": {"view_range": view_range}} for view in plots}}


def with_spatial_views_only(blueprint: Blueprint) -> Blueprint:
    """Return a blueprint without plots and texts, and without the containers that they leave empty."""
    remaining_entities = dict(blueprint)

    def keep_spatial(entity: str) -> bool:
        """Remove what is not spatial from a view or container; return whether anything remains."""
        if entity.startswith("/view"):
            remains = _kind(blueprint, entity) == "3D"
        else:
            fields = dict(blueprint[entity]["ContainerBlueprint"])
            is_kept = [keep_spatial(child) for child in _children(fields)]
            for name in ("contents", "col_shares", "row_shares"):
                if name in fields:
                    fields[name] = [value for value, keep in zip(_values(fields, name), is_kept, strict=False) if keep]
            remaining_entities[entity], remains = {"ContainerBlueprint": fields}, any(is_kept)
        if not remains:
            for name in [name for name in remaining_entities if name == entity or name.startswith(f"{entity}/")]:
                del remaining_entities[name]
        return remains

    keep_spatial(_root(blueprint))
    return remaining_entities


def clear_title_bars(picture: Image.Image, blueprint: Blueprint) -> None:
    """Paint over icons and buttons on the title bars of a picture, and move the titles to the left edge."""
    for left, top, right, _ in view_boxes(blueprint, picture.size).values():
        first, last, upper = math.ceil(left) + 1, math.floor(right) - 1, math.ceil(top) + 1
        lower = upper + TITLE_BAR - 2
        blank = picture.crop((first + 2, upper + 1, first + 3, upper + 2)).resize((last - first, lower - upper))
        title = picture.crop((first + ICON - 1, upper, max(last - BUTTONS, first + ICON), lower))
        picture.paste(blank, (first, upper))
        picture.paste(title, (first + MARGIN, upper))


def view_boxes(blueprint: Blueprint, size: tuple[int, int]) -> dict[str, Box]:
    """Return the box of each view in a picture of ``size`` [pixels]."""
    width, height = size
    return dict(_boxes(blueprint, _root(blueprint), (0.0, 0.0, float(width), float(height))))


def _boxes(blueprint: Blueprint, entity: str, box: Box) -> Iterator[tuple[str, Box]]:
    """Yield the views in a view or container that fills ``box``, with their boxes."""
    if entity.startswith("/view"):
        yield entity, box
        return
    fields, (left, top, right, bottom) = blueprint[entity]["ContainerBlueprint"], box
    children = _children(fields)
    kind = fields["container_kind"]
    n_columns = {"Horizontal": len(children), "Grid": fields.get("grid_columns", 1)}.get(kind, 1)
    n_rows = math.ceil(len(children) / max(n_columns, 1))
    columns = _split(left, right, n_columns, _values(fields, "col_shares"))
    rows = _split(top, bottom, n_rows, _values(fields, "row_shares"))
    for index, child in enumerate(children):
        (near, far), (upper, lower) = columns[index % n_columns], rows[index // n_columns]
        yield from _boxes(blueprint, child, (near, upper, far, lower))


def _split(start: float, end: float, count: int, shares: list[float]) -> list[tuple[float, float]]:
    """Return the ends of the parts of a line, which is divided in proportion to their shares."""
    used_shares = (shares or [1.0] * count)[:count]
    length, parts = end - start - GAP * (count - 1), []
    for share in used_shares:
        parts.append((start, start + length * share / sum(used_shares)))
        start = parts[-1][1] + GAP
    return parts


def _root(blueprint: Blueprint) -> str:
    return f"/container/{blueprint['/viewport']['ViewportBlueprint']['root_container']}"


def _children(container: Mapping[str, Any]) -> list[str]:
    return [f"/{child}" for child in _values(container, "contents")]


def _values(fields: Mapping[str, Any], name: str) -> list[Any]:
    """Return the values of a field; the viewer writes a single value without a list."""
    values = fields.get(name, [])
    return values if isinstance(values, list) else [values]


def _kind(blueprint: Blueprint, entity: str) -> str | None:
    """Return the class of a view; None for other entities."""
    kind: str | None = blueprint[entity].get("ViewBlueprint", {}).get("class_identifier")
    return kind

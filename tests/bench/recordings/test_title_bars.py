"""Layouts of pictures: views without the viewer's panels and buttons, and the positions of the views."""

from typing import Any

from PIL import Image
from proxbench.bench.recordings.title_bars import (
    BUTTONS,
    ICON,
    MARGIN,
    PANELS,
    TITLE_BAR,
    clear_title_bars,
    view_boxes,
    with_spatial_views_only,
    with_whole_curves,
    without_panels,
)


def view(kind: str) -> dict[str, Any]:
    return {"ViewBlueprint": {"class_identifier": kind}}


def container(kind: str, contents: list[str], **fields: Any) -> dict[str, Any]:
    return {"ContainerBlueprint": {"container_kind": kind, "contents": contents, **fields}}


LAYOUT: dict[str, Any] = {
    "/viewport": {"ViewportBlueprint": {"root_container": "root"}},
    "/container/root": container("Horizontal", ["view/a", "container/right"], col_shares=[3.0, 1.0]),
    "/container/right": container("Vertical", ["view/b", "view/c"], row_shares=[1.0, 1.0]),
    "/view/a": view("3D"),
    "/view/a/Background": {"Background": {"color": "#000000"}},
    "/view/b": view("TimeSeries"),
    "/view/b/PlotLegend": {"PlotLegend": {"visible": True}},
    "/view/c": view("TextDocument"),
    "/time_panel": {"TimePanelBlueprint": {"fps": 30.0, "state": "Collapsed"}},
    "/selection_panel": {"PanelBlueprint": {"state": "Expanded"}},
}


def test_the_panels_of_the_viewer_are_hidden_and_everything_else_is_kept() -> None:
    made = without_panels(LAYOUT)
    assert {name: made[name] for name in LAYOUT if name not in PANELS} == {
        name: LAYOUT[name] for name in LAYOUT if name not in PANELS
    }
    assert made["/time_panel"]["TimePanelBlueprint"]["fps"] == 30.0
    assert {made[panel][archetype]["state"] for panel, archetype in PANELS.items()} == {"Hidden"}
    assert LAYOUT["/selection_panel"]["PanelBlueprint"]["state"] == "Expanded"


def test_views_are_sized_in_proportion_to_their_shares() -> None:
    assert view_boxes(LAYOUT, (401, 201)) == {
        "/view/a": (0.0, 0.0, 300.0, 201.0),
        "/view/b": (301.0, 0.0, 401.0, 100.0),
        "/view/c": (301.0, 101.0, 401.0, 201.0),
    }


def test_a_container_of_one_view_is_as_large_as_the_view() -> None:
    # the viewer writes a single value without a list
    fields = {"container_kind": "Vertical", "contents": "view/a", "row_shares": 2.0}
    layout = {
        "/viewport": LAYOUT["/viewport"],
        "/container/root": {"ContainerBlueprint": fields},
        "/view/a": view("3D"),
    }
    assert view_boxes(layout, (400, 200)) == {"/view/a": (0.0, 0.0, 400.0, 200.0)}
    assert view_boxes(with_spatial_views_only(layout), (400, 200)) == {"/view/a": (0.0, 0.0, 400.0, 200.0)}


def test_a_grid_fills_its_rows_from_the_left() -> None:
    layout = {
        "/viewport": LAYOUT["/viewport"],
        "/container/root": container("Grid", ["view/a", "view/b", "view/c"], grid_columns=2),
    }
    boxes = view_boxes(layout, (201, 101))
    assert boxes == {
        "/view/a": (0.0, 0.0, 100.0, 50.0),
        "/view/b": (101.0, 0.0, 201.0, 50.0),
        "/view/c": (0.0, 51.0, 100.0, 101.0),
    }


def test_film_shows_only_spatial_views() -> None:
    made = with_spatial_views_only(LAYOUT)
    assert view_boxes(made, (400, 200)) == {"/view/a": (0.0, 0.0, 400.0, 200.0)}
    gone = ("/view/b", "/view/c", "/container/right")
    assert set(made) == {name for name in LAYOUT if not name.startswith(gone)}


def test_plots_show_all_times_and_leave_space_for_legends() -> None:
    made = with_whole_curves(LAYOUT, (0, 100))
    assert made["/view/b/TimeAxis"]["TimeAxis"]["view_range"] == {"start": {"Absolute": 0}, "end": {"Absolute": 125}}
    assert set(made) - set(LAYOUT) == {"/view/b/TimeAxis"}


def test_buttons_are_painted_over_and_titles_move_to_the_edge() -> None:
    layout = {"/viewport": LAYOUT["/viewport"], "/container/root": container("Horizontal", ["view/a"])}
    picture = Image.new("RGB", (400, 200), "black")
    picture.paste("white", (10, 8, 24, 20))  # the icon
    picture.paste("red", (ICON + 1, 8, ICON + 60, 20))  # the title
    picture.paste("white", (400 - BUTTONS + 10, 8, 390, 20))
    picture.paste("blue", (0, TITLE_BAR, 400, 200))
    clear_title_bars(picture, layout)
    red, white = (255, 0, 0), (255, 255, 255)
    places = {colour: [] for colour in (red, white)}
    for x in range(400):
        for y in range(200):
            places.get(picture.getpixel((x, y)), []).append((x, y))
    assert not places[white]
    assert min(places[red]) == (MARGIN + 2, 8)
    assert len(places[red]) == 59 * 12
    assert picture.getpixel((200, TITLE_BAR)) == (0, 0, 255)

"""Blueprints: the layout of a recording when it is opened."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun.blueprint as rrb

from ...problems.arrays import FloatArray

BACKGROUND = (22, 25, 31)
"""Colour of spatial views, similar to the viewer's dark plots."""

ITERATION, STEP, TIME = "iteration", "step", "time"
"""Timelines."""

BODIES = "bodies"
"""Entity of the bodies that all solvers share."""

FIELD_OF_VIEW = np.radians(55.0)
"""Vertical field of view of a spatial view [rad], the default of the viewer."""

FILLED_SHARE = 0.88
"""Share of the width or height of a view that its content fills."""

BESIDE, ABOVE = 0.55, 2.2
"""Aspect ratio of each of two spatial views in a still, side by side or one above the other."""

SOLVERS_IN_A_ROW = 4
"""Largest number of solvers side by side."""

SECONDS_TO_PLAY = 12.0
"""Duration of the playback of a recording of solves, within the range of speeds [s]."""

SLOWEST, FASTEST = 4.0, 120.0
"""Range of iterations per second at which a recording of solves is played."""

DRAWN_PER_SECOND = 60.0
"""Number of drawn steps of a simulation that are played per second."""


@dataclass(frozen=True, eq=False)
class Camera:
    """The camera of a spatial view.

    Attributes:
        position: its position [m], shape (3,).
        target: point that the camera faces [m], shape (3,).
    """

    position: FloatArray
    target: FloatArray

    @classmethod
    def around(cls, low: FloatArray, high: FloatArray, distance: float, direction: Sequence[float]) -> "Camera":
        """Return the camera that faces the middle of a box from a distance [m].

        Args:
            low: lowest corner of the box [m], shape (3,).
            high: highest corner [m], shape (3,).
            distance: distance from the middle to the camera [m].
            direction: unit vector from the middle to the camera, shape (3,).
        """
        middle = (low + high) / 2.0
        return cls(middle + distance * np.array(direction), middle)


class CameraFit:
    """The closest camera that shows all included points.

    A point x is visible from p if (x − p) · n ≥ 0 for the normal n of each of the four sides of the view. The
    position of the camera therefore depends only on the smallest x · n of all points for each n.

    Args:
        direction: from the points to the camera, shape (3,).
        aspect: width of the view over its height.
    """

    def __init__(self, direction: Sequence[float], aspect: float) -> None:
        self._forward = -np.array(direction) / np.linalg.norm(direction)
        right = np.cross(self._forward, (0.0, 0.0, 1.0))
        self._right = right / np.linalg.norm(right)
        self._up = np.cross(self._right, self._forward)
        self._slopes = FILLED_SHARE * np.tan(0.5 * FIELD_OF_VIEW) * np.array([aspect, 1.0])
        across, along = self._slopes[:, None] * self._forward
        self._normals = np.array([across + self._right, across - self._right, along + self._up, along - self._up])
        self._min_products, self._depths = np.full(4, np.inf), np.array([np.inf, -np.inf])

    def include(self, points: FloatArray) -> None:
        """Include points [m], shape (n, 3)."""
        if len(points):
            self._min_products = np.minimum(self._min_products, (points @ self._normals.T).min(axis=0))
            depths = points @ self._forward
            self._depths = np.array([min(depths.min(), self._depths[0]), max(depths.max(), self._depths[1])])

    @property
    def depth(self) -> float:
        """Position of the camera along its line of sight [m]; larger is closer."""
        return float((self._min_products.reshape(2, 2).sum(axis=1) / (2.0 * self._slopes)).min())

    def camera(self) -> Camera:
        """Return the camera, which faces the middle of the points in depth."""
        across, along = -0.5 * np.diff(self._min_products.reshape(2, 2), axis=1).ravel()
        offset = across * self._right + along * self._up
        middle = float(self._depths.mean())
        return Camera(offset + self.depth * self._forward, offset + middle * self._forward)


def space_view(name: str, camera: Camera, contents: Sequence[str], tracking: str | None = None) -> rrb.Spatial3DView:
    """Return a spatial view of the entities ``contents`` from ``camera``, which follows ``tracking`` if given."""
    return rrb.Spatial3DView(
        origin="/",
        contents=list(contents),
        name=name,
        background=rrb.Background(color=BACKGROUND),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=camera.position, look_target=camera.target, eye_up=(0.0, 0.0, 1.0), tracking_entity=tracking
        ),
    )


def plot(name: str, origin: str, legend: bool = True, heights: tuple[float, float] | None = None) -> rrb.TimeSeriesView:
    """Return a plot of the curves under ``origin``, optionally with a legend at the top right.

    ``heights`` are the smallest and the largest value shown; if None, those of the curves.
    """
    axis = None if heights is None else rrb.ScalarAxis(range=heights)
    plot_legend = rrb.PlotLegend(rrb.Corner2D.RightTop, visible=legend)
    return rrb.TimeSeriesView(origin=origin, name=name, plot_legend=plot_legend, axis_y=axis)


def set_axis_range(view: rrb.TimeSeriesView, heights: tuple[float, float]) -> None:
    """Limit the axis of a plot to the values between the two ``heights``."""
    view.properties["ScalarAxis"] = rrb.ScalarAxis(range=heights)


def solves_blueprint(
    solvers: Sequence[str], n_iterations: int, camera: Camera, heights: tuple[float, float] | None
) -> rrb.Blueprint:
    """Return the layout of solves: solvers side by side with their contact states, above the curves of all solvers.

    Args:
        solvers: their names; the entities of solver k are ``/solvers/k`` and ``/states/k``.
        n_iterations: largest iteration number, which determines the playback speed.
        camera: camera of all spatial views.
        heights: range of log₁₀ residuals; None for that of the curves.
    """
    columns = [
        rrb.Vertical(
            space_view(name, camera, [f"/solvers/{index}/**", f"/{BODIES}/**"]),
            plot("contact states", f"/states/{index}"),
            row_shares=[3, 1.3],
            name=name,
        )
        for index, name in enumerate(solvers)
    ]
    side_by_side: rrb.Container = rrb.Grid(*columns, grid_columns=min(len(columns), SOLVERS_IN_A_ROW))
    if len(columns) <= SOLVERS_IN_A_ROW:
        side_by_side = rrb.Horizontal(*columns)
    curves = rrb.Horizontal(
        plot("log₁₀ residual (judge)", "/curves/residual", heights=heights),
        plot("log₁₀ complementarity [J]", "/curves/complementarity", legend=False),
        plot("log₁₀ step change [N s]", "/curves/step_change", legend=False),
        rrb.TextDocumentView(origin="/about", name="what this shows"),
        column_shares=[1, 1, 1, 1.2],
    )
    frames = min(max(n_iterations / SECONDS_TO_PLAY, SLOWEST), FASTEST)
    return _blueprint(rrb.Vertical(side_by_side, curves, row_shares=[2, 1]), ITERATION, frames)


def simulation_blueprint(
    views: Sequence[rrb.Spatial3DView], plots: Sequence[rrb.TimeSeriesView], every: int, is_stacked: bool = False
) -> rrb.Blueprint:
    """Return the layout of a simulation: spatial views, with curves and an explanation to their right.

    One of ``every`` steps is drawn; sixty drawn steps are played per second. Views are side by side, or one above the
    other if ``is_stacked``.
    """
    about = rrb.TextDocumentView(origin="/about", name="what this shows")
    column = rrb.Vertical(*plots, about, row_shares=[1.0] * len(plots) + [1.3])
    content: Sequence[rrb.Spatial3DView | rrb.Container] = [rrb.Vertical(*views)] if is_stacked else views
    width = len(views) / max(len(content), 1)
    layout = rrb.Horizontal(*content, column, column_shares=[width] * len(content) + [1.0])
    return _blueprint(layout, STEP, DRAWN_PER_SECOND * every)


def _blueprint(content: rrb.Container, timeline: str, frames: float) -> rrb.Blueprint:
    """Return a blueprint that plays ``frames`` units of a timeline per second."""
    return rrb.Blueprint(
        content,
        rrb.TimePanel(state="collapsed", timeline=timeline, fps=frames, play_state="playing", loop_mode="off"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_layout=False,
        auto_views=False,
    )

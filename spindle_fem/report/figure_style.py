"""Style, canvas and composition shared by every picture and chart.

A figure is a matplotlib ``Figure`` sized in pixels; three-dimensional views
arrive as images with a projection, so that text, leaders and colour bars are
set by matplotlib in one type on all pictures.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from PIL.Image import Image

    from spindle_fem.report.scenes import Picture

DPI = 160
WIDTH_PX = 1600


def _lightened(name: str, share: float) -> LinearSegmentedColormap:
    # Perceptually uniform maps start so dark that outlines vanish; a little white keeps their order.
    colours = mpl.colormaps[name](np.linspace(0.0, 1.0, 256))[:, :3]
    return LinearSegmentedColormap.from_list(f"spindle_{name}", colours + share * (1.0 - colours))


TEMPERATURE_MAP = _lightened("plasma", 0.16)
FILM_MAP = _lightened("viridis", 0.12)
TEMPERATURE_LABEL = "temperature / °C"

INK = "#1d2733"
MUTED = "#5b6875"
GRID = "#dfe4e9"
# Okabe & Ito: distinct for colour-blind readers, in this order everywhere.
CYCLE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8c6d31", "#6b6b6b")
INNER, BALLS, OUTER = "#D55E00", "#E69F00", "#0072B2"
# Bodies that friction heat enters, by their keys in ``heat_to``.
BODY_COLOURS = {"inner": INNER, "balls": BALLS, "outer": OUTER}
BODY_NAMES = {"inner": "inner ring", "balls": "balls", "outer": "outer ring"}

_STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.5,
    "text.color": INK,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    # where it would be put anyway, without measuring every label of the axes first
    "axes.titley": 1.0,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.prop_cycle": mpl.cycler(color=CYCLE),
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.8,
    "hatch.linewidth": 0.6,
}


@dataclass(frozen=True, slots=True)
class Label:
    """Text with a leader to a place, which is (3,) in m for pictures, (2,) in data units for charts."""

    text: str
    at: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ColourBar:
    """One colour scale: its map, its limits, its label with the unit, and which end values go beyond."""

    colour_map: Colormap
    low: float
    high: float
    label: str
    extend: str = "neither"

    @property
    def norm(self) -> Normalize:
        """Scale from value to 0–1."""
        return Normalize(self.low, self.high)

    def colours(self, values: ArrayLike) -> NDArray[np.float64]:
        """RGBA of values."""
        return self.colour_map(self.norm(np.asarray(values, dtype=np.float64)))


def scale_of(values: ArrayLike, colour_map: Colormap, label: str) -> ColourBar:
    """Colour scale over the finite range of values; a constant gets a scale of its own width.

    >>> scale_of([20.0, 31.0], TEMPERATURE_MAP, TEMPERATURE_LABEL).high
    31.0
    """
    array = np.asarray(values, dtype=np.float64)
    low, high = float(np.nanmin(array)), float(np.nanmax(array))
    if high - low < 1.0e-6 * max(abs(high), 1.0):
        margin = 0.5 * max(1.0e-3 * abs(high), 0.1)
        low, high = low - margin, high + margin
    return ColourBar(colour_map, low, high, label)


def grouped(number: int) -> str:
    r"""Whole number with narrow spaces between thousands.

    >>> grouped(1234567).replace("\u202f", " ")
    '1 234 567'
    """
    return f"{number:,}".replace(",", "\u202f")


def new_figure(height_px: float, width_px: float = WIDTH_PX) -> Figure:
    """Empty white figure of a size in pixels, with the house style."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width_px / DPI, height_px / DPI), dpi=DPI, facecolor="white")
        FigureCanvasAgg(figure)
    return figure


def styled(draw: Any) -> Any:
    """Decorator: run a drawing function with the house style."""
    from functools import wraps

    @wraps(draw)
    def wrapper(*arguments: Any, **keywords: Any) -> Any:
        with mpl.rc_context(_STYLE):
            return draw(*arguments, **keywords)

    return wrapper


@styled
def rasterise(figure: Figure) -> NDArray[np.uint8]:
    """Pixels (height, width, 3) of a figure, its pictures behind everything else."""
    figure.canvas.draw()
    drawn = np.asarray(figure.canvas.buffer_rgba())
    backdrops = getattr(figure, "backdrops", ())
    if not backdrops:
        return np.ascontiguousarray(drawn[..., :3])
    pixels = np.full((*drawn.shape[:2], 3), 255, dtype=np.uint8)
    for image, left, top in backdrops:
        pixels[top : top + image.shape[0], left : left + image.shape[1]] = image
    covered = drawn[..., 3] > 0
    opacity = drawn[covered, 3:].astype(np.float32) / 255.0
    pixels[covered] = np.round(opacity * drawn[covered, :3] + (1.0 - opacity) * pixels[covered])
    return pixels


def save_png(figure: Figure, path: Path, *, colours: int = 0) -> Path:
    """Write a figure, in true colour or with a palette of ``colours`` where it has few."""
    return write_png(image_of(figure, colours=colours), path)


def image_of(figure: Figure, *, colours: int = 0) -> Image:
    """Image of a figure as it is written: in true colour, or with a palette of ``colours``."""
    from PIL import Image

    image = Image.fromarray(rasterise(figure))
    if colours:
        image = image.quantize(colours, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        palette = image.getpalette()
        corner = 3 * image.getpixel((0, 0))
        palette[corner : corner + 3] = (255, 255, 255)  # the method rounds white
        image.putpalette(palette)
    return image


def write_png(image: Image, path: Path) -> Path:
    """Write an image of a figure."""
    image.save(path, dpi=(DPI, DPI), compress_level=6)
    return path


def pixel_axes(figure: Figure, left: float, top: float, width: float, height: float, **keywords: Any) -> Axes:
    """Axes placed in pixels from the upper left corner of the figure."""
    full_width, full_height = figure.get_size_inches() * DPI
    return figure.add_axes(
        (left / full_width, 1.0 - (top + height) / full_height, width / full_width, height / full_height),
        **keywords,
    )


def spread(positions: ArrayLike, widths: ArrayLike, low: float, high: float) -> NDArray[np.float64]:
    """Places on a line nearest to ``positions`` at which items of ``widths`` do not overlap.

    Parameters
    ----------
    positions, widths : (n,) array_like
    low, high : float
        Ends of the line; when all items together are longer they are packed
        evenly and overlap.

    Returns
    -------
    (n,) ndarray
        Centres, in the order given.

    >>> spread([0.0, 0.1, 5.0], [1.0, 1.0, 1.0], -10.0, 10.0).round(2).tolist()
    [-0.45, 0.55, 5.0]
    """
    wanted = np.asarray(positions, dtype=np.float64)
    size = np.asarray(widths, dtype=np.float64)
    order = np.argsort(wanted, kind="stable")
    squeeze = min(1.0, (high - low) / size.sum()) if size.sum() > 0.0 else 1.0
    groups: list[list[Any]] = []  # [items, total width, centre]
    for item in order:
        groups.append([[item], size[item] * squeeze, wanted[item]])
        while True:
            last = groups[-1]
            last[2] = min(max(last[2], low + 0.5 * last[1]), high - 0.5 * last[1])
            if len(groups) < 2 or groups[-2][2] + 0.5 * groups[-2][1] <= last[2] - 0.5 * last[1] + 1e-12:
                break
            right, left = groups.pop(), groups.pop()
            items = left[0] + right[0]
            inner = np.cumsum([0.0] + [size[i] * squeeze for i in items])
            centres = 0.5 * (inner[1:] + inner[:-1])
            total = float(inner[-1])
            middle = float(np.mean(wanted[items] - centres)) + 0.5 * total
            groups.append([items, total, middle])
    places = np.empty(len(wanted))
    for items, total, middle in groups:
        edge = middle - 0.5 * total
        for item in items:
            places[item] = edge + 0.5 * size[item] * squeeze
            edge += size[item] * squeeze
    return places


@styled
def picture_figure(
    picture: Picture,
    title: str,
    *,
    bars: Sequence[ColourBar] = (),
    above: Sequence[Label] = (),
    below: Sequence[Label] = (),
    notes: str = "",
) -> Figure:
    """One picture with its title, labels on leaders above and below, and colour bars.

    Parameters
    ----------
    picture : Picture
        Shown pixel by pixel; the figure is a little wider.
    title : str
    bars : sequence of ColourBar
        Drawn side by side under the picture.
    above, below : sequence of Label
        Set in a row, spread so that they do not overlap, each with a leader
        to its place in the picture.
    notes : str
        One line under the title.
    """
    width_px = picture.width + 2.0 * _MARGIN
    top = _head(notes) + _rail(above)
    foot = _rail(below) + (112.0 if bars else 8.0)
    figure, axes = _canvas(top + picture.height + foot, width_px, title, notes)
    _place(figure, picture, _MARGIN, top)
    offset, ends = np.array([_MARGIN, top]), (_MARGIN, width_px - _MARGIN)
    _leaders(axes, picture, above, offset, top - 12.0, -1.0, ends)
    _leaders(axes, picture, below, offset, top + picture.height + 12.0, 1.0, ends)
    for number, bar in enumerate(bars):
        share = picture.width / len(bars)
        length = min(760.0, share - 60.0)
        left = _MARGIN + share * (number + 0.5) - 0.5 * length
        draw_colour_bar(pixel_axes(figure, left, top + picture.height + foot - 92.0, length, 20.0), bar)
    return figure


@styled
def pictures_side_by_side(
    pictures: Sequence[Picture],
    title: str,
    bars: Sequence[ColourBar],
    labels: Sequence[Sequence[Label]],
    *,
    notes: str = "",
) -> Figure:
    """Pictures in a row, each with its own colour bar and labels above it."""
    top = _head(notes) + max(_rail(items) for items in labels)
    height = max(picture.height for picture in pictures)
    width_px = sum(picture.width for picture in pictures) + 40.0 * (len(pictures) - 1) + 2.0 * _MARGIN
    total = top + height + 124.0
    figure, axes = _canvas(total, width_px, title, notes)
    left = _MARGIN
    for picture, bar, items in zip(pictures, bars, labels, strict=True):
        _place(figure, picture, left, top)
        _leaders(axes, picture, items, np.array([left, top]), top - 12.0, -1.0, (left, left + picture.width))
        draw_colour_bar(
            pixel_axes(figure, left + 0.1 * picture.width, total - 92.0, 0.8 * picture.width, 20.0), bar
        )
        left += picture.width + 40.0
    return figure


_MARGIN = 24.0


def _head(notes: str) -> float:
    return 82.0 if notes else 52.0


def _rail(labels: Sequence[Label]) -> float:
    lines = max((label.text.count("\n") + 1 for label in labels), default=0)
    return 34.0 + 27.0 * lines if lines else 8.0


def _canvas(height_px: float, width_px: float, title: str, notes: str) -> tuple[Figure, Axes]:
    figure = new_figure(round(height_px), width_px)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, width_px), ylim=(round(height_px), 0.0))
    axes.axis("off")
    axes.text(_MARGIN, 34.0, title, fontsize=12.5, fontweight="bold", va="center")
    if notes:
        axes.text(_MARGIN, 66.0, notes, fontsize=9.0, color=MUTED, va="center")
    return figure, axes


def _place(figure: Figure, picture: Picture, left: float, top: float) -> None:
    # Pasted pixel by pixel on saving: resampling would blur thin lines and cost more than all the rest.
    figure.patch.set_alpha(0.0)
    figure.backdrops = [*getattr(figure, "backdrops", []), (picture.image, round(left), round(top))]


def set_title(figure: Figure, title: str, notes: str = "") -> None:
    """Title in the upper left corner, with a line of notes under it; both lie in the first 82 pixels."""
    width, height = figure.get_size_inches() * DPI
    figure.text(24.0 / width, 1.0 - 34.0 / height, title, fontsize=12.5, fontweight="bold", va="center")
    if notes:
        figure.text(24.0 / width, 1.0 - 66.0 / height, notes, fontsize=9.0, color=MUTED, va="center")


def draw_colour_bar(axes: Axes, bar: ColourBar) -> None:
    """Horizontal colour bar with its label."""
    figure = axes.figure
    drawn = figure.colorbar(
        ScalarMappable(bar.norm, bar.colour_map), cax=axes, orientation="horizontal", extend=bar.extend
    )
    drawn.set_label(bar.label, fontsize=9.5)
    drawn.outline.set_linewidth(0.6)
    drawn.ax.tick_params(labelsize=9.0)


def _leaders(
    axes: Axes,
    picture: Picture,
    labels: Iterable[Label],
    offset: NDArray[np.float64],
    edge: float,
    sign: float,
    ends: tuple[float, float],
) -> None:
    labels = list(labels)
    if not labels:
        return
    places = picture.to_pixels(np.array([label.at for label in labels])) + offset
    longest = [max(len(line) for line in label.text.split("\n")) for label in labels]
    widths = [12.6 * characters + 22.0 for characters in longest]
    centres = spread(places[:, 0], widths, *ends)
    for label, place, centre in zip(labels, places, centres, strict=True):
        axes.annotate(
            label.text,
            xy=place,
            xytext=(centre, edge),
            ha="center",
            va="bottom" if sign < 0.0 else "top",
            fontsize=9.0,
            linespacing=1.25,
            arrowprops={
                "arrowstyle": "-",
                "color": INK,
                "linewidth": 0.8,
                "shrinkA": 1.0,
                "shrinkB": 0.0,
                "relpos": (0.5, 0.0 if sign < 0.0 else 1.0),
                "path_effects": [Stroke(linewidth=2.6, foreground="white", alpha=0.85), Normal()],
            },
        )
        axes.plot(*place, marker="o", markersize=4.5, markerfacecolor="white", markeredgecolor=INK, zorder=5)

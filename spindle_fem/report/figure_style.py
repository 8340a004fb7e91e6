"""Style, canvas and colour bars shared by every picture and chart.

A figure is a matplotlib ``Figure`` sized in pixels.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import ArrayLike, NDArray

from spindle_fem.results.output_folder import whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.text import Text
    from PIL.Image import Image

DPI = 160
# A tenth larger files than the usual 6 in three quarters of the time.
PNG_LEVEL = 4
WIDTH_PX = 1600


def _lightened(name: str, share: float) -> LinearSegmentedColormap:
    # Perceptually uniform maps start so dark that outlines vanish; a little white keeps their order.
    colours = mpl.colormaps[name](np.linspace(0.0, 1.0, 256))[:, :3]
    return LinearSegmentedColormap.from_list(f"spindle_{name}", colours + share * (1.0 - colours))


TEMPERATURE_MAP = _lightened("plasma", 0.16)
FILM_MAP = _lightened("viridis", 0.12)
DIFFERENCE_MAP = mpl.colormaps["RdBu_r"]
TEMPERATURE_LABEL = "temperature / °C"

INK = "#1d2733"
MUTED = "#5b6875"
GRID = "#dfe4e9"
# Okabe & Ito: distinct for colour-blind readers, in this order everywhere.
CYCLE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8c6d31", "#6b6b6b")
INNER, BALLS, OUTER = "#D55E00", "#E69F00", "#0072B2"
# Bodies that friction heat enters, by their keys in ``heat_to``.
BODY_COLOURS = {"inner": INNER, "balls": BALLS, "outer": OUTER}
BODY_NAMES = {"inner": "inner ring", "balls": "rolling elements", "outer": "outer ring"}

_STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.5,
    # a dollar sign in a name begins no formula
    "text.parse_math": False,
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
class ColourBar:
    """One colour scale: its map, its limits, its label with the unit, and which ends are exceeded."""

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


def plain_decades(axis: Axis) -> None:
    """Plain numbers, 1, 2, 5 and so on, along a logarithmic axis."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    # the numbered ticks are dense enough, and each tick costs as much to draw as a line
    axis.set_minor_locator(NullLocator())


class ShownFigure(Figure):
    """A figure that notebooks draw when it is the last value of a cell."""

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png")
        return stream.getvalue()


def new_figure(height_px: float, width_px: float = WIDTH_PX) -> Figure:
    """Empty white figure of a size in pixels, with the house style."""
    with mpl.rc_context(_STYLE):
        figure = ShownFigure(figsize=(width_px / DPI, height_px / DPI), dpi=DPI, facecolor="white")
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
    """Write an image atomically: a resumed sweep reuses its pictures."""
    with whole_file(path) as partial:
        image.save(partial, "PNG", dpi=(DPI, DPI), compress_level=PNG_LEVEL)
    return path


def pixel_axes(figure: Figure, left: float, top: float, width: float, height: float, **keywords: Any) -> Axes:
    """Axes placed in pixels from the upper left corner of the figure."""
    full_width, full_height = figure.get_size_inches() * DPI
    return figure.add_axes(
        (left / full_width, 1.0 - (top + height) / full_height, width / full_width, height / full_height),
        **keywords,
    )


def set_title(figure: Figure, title: str, notes: str = "") -> None:
    """Title in the upper left corner, with a line of notes under it; both lie in the first 82 pixels.

    What is wider than the figure is set smaller, to two thirds, and shortened where that does not suffice.
    """
    width, height = figure.get_size_inches() * DPI
    lines = [
        figure.text(24.0 / width, 1.0 - 34.0 / height, title, fontsize=12.5, fontweight="bold", va="center")
    ]
    if notes:
        lines.append(
            figure.text(24.0 / width, 1.0 - 66.0 / height, notes, fontsize=9.0, color=MUTED, va="center")
        )
    for line in lines:
        _fit(line, (width - 48.0) / DPI * figure.dpi)


def _fit(line: Text, room: float) -> None:
    """Set a line of text smaller, or shorten it, until it is no wider than some pixels."""
    share = room / max(line.get_window_extent().width, 1.0)
    if share >= 1.0:
        return
    line.set_fontsize(line.get_fontsize() * max(share, 2.0 / 3.0))
    text = line.get_text()
    while line.get_window_extent().width > room and text:
        text = text[: int(0.97 * len(text))].rstrip()
        line.set_text(f"{text} …")


def draw_colour_bar(axes: Axes, bar: ColourBar) -> None:
    """Horizontal colour bar with its label."""
    figure = axes.figure
    drawn = figure.colorbar(
        ScalarMappable(bar.norm, bar.colour_map), cax=axes, orientation="horizontal", extend=bar.extend
    )
    drawn.set_label(bar.label, fontsize=9.5)
    drawn.outline.set_linewidth(0.6)
    drawn.ax.tick_params(labelsize=9.0)

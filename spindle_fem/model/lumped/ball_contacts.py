"""Ball contacts whose conductance follows the temperature of their film."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from spindle_fem.model.lumped.heat_laws import FrictionLaw, Triplets

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ContactFaces:
    """Faces of one raceway on the way between its nodes and the balls.

    Attributes
    ----------
    bearing : int
        Row of the friction law.
    node : (k,) int64 ndarray
    area_share : (k,) ndarray, [-]
    resistance : (k,) ndarray, [K/W]
        From the face into its node.
    heat_share : (k,) ndarray, [-]
        Of the bearing's heat, given to the face.
    conductance : float, [W/K]
        That links and heat shares of the network were made with.
    table : CubicHermiteSpline
        Conductance (W/K) over film temperature (K), all raceways at the same temperatures.
    """

    bearing: int
    node: Index
    ball: int
    area_share: Array
    resistance: Array
    heat_share: Array
    conductance: float
    table: CubicHermiteSpline


@dataclass(frozen=True, slots=True)
class BallContactLaw:
    """Changes of the links and heat shares of the ball rows with moving film temperatures.

    Arrays over all faces of all raceways; made by :meth:`of`.

    Attributes
    ----------
    friction : FrictionLaw
        Of the same bearings.
    node, ball, bearing, raceway : (m,) int64 ndarray
        ``raceway`` is the table that a face follows.
    area_share, resistance, heat_share, link, kept : (m,) ndarray
        ``link`` (W/K) and ``kept`` are those of the network.
    breaks : (k + 1,) ndarray, [K]
    coefficients : (4, k, n_raceways) ndarray
    film : (n_raceways,) int64 ndarray
        Bearing of each raceway.
    feeling : two (p,) int64 ndarrays, (p,) ndarray
        Faces, nodes that their film's temperature depends on, and by how much.
    """

    friction: FrictionLaw
    n_nodes: int
    node: Index
    ball: Index
    bearing: Index
    raceway: Index
    area_share: Array
    resistance: Array
    heat_share: Array
    link: Array
    kept: Array
    breaks: Array
    coefficients: Array
    film: Index
    feeling: tuple[Index, Index, Array]

    @classmethod
    def of(cls, faces: Sequence[ContactFaces], friction: FrictionLaw, n_nodes: int) -> BallContactLaw:
        """Law of the raceways of a machine."""
        counts = [len(face.node) for face in faces]

        def spread(values: Sequence, kind: type) -> NDArray:
            return np.repeat(np.array(values, dtype=kind), counts)

        area_share = np.concatenate([face.area_share for face in faces])
        resistance = np.concatenate([face.resistance for face in faces])
        link, kept = _link(spread([face.conductance for face in faces], float), area_share, resistance)
        bearing = spread([face.bearing for face in faces], np.int64)
        feels = [np.flatnonzero(row) for row in friction.weights]
        which = np.concatenate([np.full(len(feels[b]), i) for i, b in enumerate(bearing.tolist())])
        columns = np.concatenate([feels[b] for b in bearing.tolist()])
        return cls(
            friction=friction,
            n_nodes=n_nodes,
            node=np.concatenate([face.node for face in faces]),
            ball=spread([face.ball for face in faces], np.int64),
            bearing=bearing,
            raceway=spread(range(len(faces)), np.int64),
            area_share=area_share,
            resistance=resistance,
            heat_share=np.concatenate([face.heat_share for face in faces]),
            link=link,
            kept=kept,
            breaks=faces[0].table.x,
            coefficients=np.stack([face.table.c for face in faces], axis=-1),
            film=np.array([face.bearing for face in faces]),
            feeling=(which, columns, friction.weights[bearing[which], columns]),
        )

    def require_valid(self, temperature: Array) -> None:
        """The friction law refuses what lies beyond the tables."""

    def conductance(self, film_temperature: Array) -> tuple[Array, Array]:
        """Conductance of every raceway (W/K) and slope (W/K²) at films (K); constant beyond the tables."""
        kelvin = film_temperature[self.film]
        at = np.minimum(np.maximum(kelvin, self.breaks[0]), self.breaks[-1])
        piece = np.minimum(np.searchsorted(self.breaks[1:-1], at, side="right"), len(self.breaks) - 2)
        x = at - self.breaks[piece]
        c3, c2, c1, c0 = self.coefficients[:, piece, np.arange(len(self.film))]
        slope = np.where(at == kelvin, (3.0 * c3 * x + 2.0 * c2) * x + c1, 0.0)
        return ((c3 * x + c2) * x + c1) * x + c0, slope

    def __call__(self, temperature: Array) -> tuple[Array, Triplets]:
        """Heat into every node and its derivative."""
        law = self.friction
        heat, heat_slope = law.heat(temperature)
        conductance, rise = self.conductance(law.weights @ temperature + law.feedback * heat)
        link, kept = _link(conductance[self.raceway], self.area_share, self.resistance)
        drop = temperature[self.node] - temperature[self.ball]
        b, own = self.bearing, self.link - link
        # a face feels its film by the conductance, and by the heat that is shared
        softer = kept**2 * self.area_share
        by_film = -softer * (drop + heat[b] * self.heat_share * self.resistance) * rise[self.raceway]
        by_base = by_film * (1.0 + law.feedback[b] * heat_slope[b])
        by_base += self.heat_share * (kept - self.kept) * heat_slope[b]
        which, columns, weight = self.feeling
        felt = by_base[which] * weight
        rows = (self.node, self.node, self.ball, self.ball, self.node[which], self.ball[which])
        places = (self.node, self.ball, self.node, self.ball, columns, columns)
        values = (own, -own, -own, own, felt, -felt)
        triplets = tuple(np.concatenate(part) for part in (rows, places, values))
        moved = own * drop + heat[b] * self.heat_share * (kept - self.kept)
        n = self.n_nodes
        return np.bincount(self.node, moved, n) - np.bincount(self.ball, moved, n), triplets


def _link(conductance: Array, area_share: Array, resistance: Array) -> tuple[Array, Array]:
    """Conductance from node to balls (W/K), and share of a face's heat that enters the ring."""
    contact = conductance * area_share
    kept = 1.0 / (1.0 + contact * resistance)
    return contact * kept, kept

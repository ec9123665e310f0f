r"""Film of a smooth seal in each direction, from its dry contact: the inverse theory of Blok.

The film is as thick as the steepest rise of the pressure on its way in lets it be. The pressure of a dry contact rises
as a square root at its edge, so its steepest rise is infinite, and that of a mesh is as large as the mesh is fine. The
film rounds the edge: what counts is the strength of the edge,

.. math:: k = \lim_{\xi \to 0} \frac{\sigma - P}{\sqrt{\xi}}

with the distance :math:`\xi` from the edge and the fluid pressure P before it.
"""

import math
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.oring_contact.results import WallContact

_INLET = 0.37
"""dp/dx over k^1.6 (eta U)^-0.2 E*^-0.4 of the steepest rise where a film enters an edge: a fit to the films of smooth
Hertzian line contacts by `lubrication.contact` (our choice)"""
_RISE = 0.95  # of the rise to the peak, up to which the edge is fitted: beyond it the stress is level (our choice)
_CLEAR = 2.0  # rise over the transition between fluid and contact, from which a node counts (our choice)
_FEWEST = 3  # nodes of an edge; with fewer the contact ends at a corner, or the mesh is too coarse


class SealFilm(NamedTuple):
    """Film under a smooth seal in steady sliding, full of fluid on both sides."""

    out: float  # wall moves away from the pressure: height of the film that flows with half the speed of the wall [m]
    back: float  # the same where the wall moves towards the pressure [m]
    leakage: float
    """volume dragged out less the volume that the way back can take, over the length of a stroke [m^3/m]; negative: the
    seal is tight"""


def inverse_film(steepest_rise: float, viscosity: float, speed: float) -> float:
    r"""Height of the film that flows [m]: :math:`h^* = \sqrt{\frac{8 \eta U}{9 (dp/dx)_{max}}}`.

    Args:
        steepest_rise: (dp/dx)max of the pressure in the film, on the way in [Pa/m].
        viscosity: eta of the fluid [Pa s].
        speed: U of the wall, the seal at rest [m/s].

    Source: [Blok1963]_, [MuellerNau1998]_. It is where the pressure has its peak; at the steepest rise the film is 1.5
    h* high, and behind the seal a layer of h*/2 leaves with the wall.
    """
    return math.sqrt(8.0 * viscosity * speed / (9.0 * steepest_rise))


def inlet_rise(strength: float, plane_modulus: float, viscosity: float, speed: float) -> float:
    r"""Steepest rise of the pressure of a film that enters a dry edge [Pa/m].

    .. math:: (dp/dx)_{max} = 0.37\,k^{8/5} (\eta U)^{-1/5} {E^*}^{-2/5}

    The powers follow from the gap before the edge, which grows as :math:`k\,\xi^{3/2} / E^*`, and from
    `inverse_film`.

    Args:
        strength: k of the edge [Pa/m^0.5].
        plane_modulus: E* = E / (1 - nu^2) of the seal on its rigid wall [Pa].
        viscosity: eta [Pa s].
        speed: U [m/s].
    """
    return _INLET * float(strength**1.6 * (viscosity * speed) ** -0.2 * plane_modulus**-0.4)


def seal_film(
    contact: WallContact, pressure: float, elasticity: tuple[float, float], fluid: tuple[float, float]
) -> SealFilm | None:
    """Film of a seal by its dry contact on the sliding wall; of several lips the strongest edge on the way in decides.

    None: a lip ends at a corner of its section, where the radius of the corner decides, which is not in the model, or
    has too few nodes at an edge.

    Args:
        contact: Contact on the sliding wall, the fluid at its low end.
        pressure: Of the fluid [Pa, gauge].
        elasticity: E* of the seal and transition between fluid and contact [Pa].
        fluid: Viscosity [Pa s] and speed of the wall [m/s].
    """
    plane_modulus, transition = elasticity
    strengths = edge_strengths(contact, pressure, transition)
    if strengths is None:
        return None
    viscosity, speed = fluid
    out, back = (
        inverse_film(inlet_rise(float(strength), plane_modulus, viscosity, speed), viscosity, speed)
        for strength in strengths.max(axis=0)
    )
    return SealFilm(out, back, 0.5 * (out - back) * contact.circumference)


def edge_strengths(contact: WallContact, pressure: float, transition: float) -> FloatArray | None:
    """Strength of the upstream and the downstream edge of each lip [Pa/m^0.5], shape (lips, 2); None: see `seal_film`.

    The ``pressure`` [Pa] stands before the first lip, nothing between the lips and behind them.
    """
    if not len(contact.position):
        return None
    place = np.concatenate(([contact.edges[0]], contact.position, [contact.edges[1]]))
    stress = np.concatenate(([0.0], contact.stress, [0.0]))
    ends = np.flatnonzero(stress == 0.0).reshape(-1, 2)
    found = []
    for number, (first, last) in enumerate(ends):
        inside, before = slice(first + 1, last), pressure if number == 0 else 0.0
        upstream = place[inside] - place[first], stress[inside] - before
        downstream = (place[last] - place[inside])[::-1], stress[inside][::-1]
        found.append([_strength(*upstream, transition), _strength(*downstream, transition)])
    strengths = np.array(found)
    return strengths if np.isfinite(strengths).all() else None


def _strength(distance: FloatArray, rise: FloatArray, transition: float) -> float:
    r"""Strength by least squares of :math:`\sigma^2 = k^2 \xi (1 - \xi / 2a)`, that of Hertz; nan: too few nodes.

    The half width a follows from the first node that has `_RISE` of the peak, the first from the edge on;
    behind it the stress falls by a tenth or more (our choice).
    """
    peak = np.maximum.accumulate(rise)
    fallen = (peak > _CLEAR * transition) & (rise < 0.9 * peak)
    rise = rise[: int(np.argmax(fallen)) if fallen.any() else len(rise)]
    distance = distance[: len(rise)]
    top = int(np.argmax(rise >= _RISE * rise.max()))
    fitted = (np.arange(len(rise)) <= top) & (rise > _CLEAR * transition)
    if fitted.sum() < _FEWEST:
        return math.nan
    half_width = distance[top] / (1.0 - math.sqrt(1.0 - (rise[top] / rise.max()) ** 2))
    shape = (distance * (1.0 - distance / (2.0 * half_width)))[fitted]
    return math.sqrt(float(shape @ rise[fitted] ** 2 / (shape @ shape)))

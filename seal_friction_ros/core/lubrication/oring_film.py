r"""The film under a finite-element O-ring: how the ring rests on the wall, and how it gives way to the film.

The ring is first pressed on a dry rod or bore (`oring_contact`, finite strain). Film and asperities then change the
pressure on its face, and the gap follows linearly about that state,

.. math:: h = s + K\,(p + p_c(h) - b), \quad s = g_0 - C\,A\,(q_0 - b)

with the compliances K of the cells (`elasticity.condensed_body`) and C of the nodes, areas A of the nodes, and gap g_0
and pressure q_0 of the dry ring at its nodes. The pressure b falls linearly from one end of the film to the other. So s
is the face without what presses on it: smooth, where gap and pressure have edges that lie between two nodes (our
choice; interpolating gap and pressure moves the friction at 0.1 m/s by up to 10 % from one mesh to the next).

The film reaches a quarter of the contact width beyond both edges of the contact, as far as the face is less steep than
45 degrees (our choice). Under a high pressure that is next to the wall of the groove, where the face turns away within
some 60 um: the elements are small there.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.lubrication.contact import ContactState, LubricatedContact, dry_contact
from seal_friction_ros.core.lubrication.elasticity import condensed_body
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase
from seal_friction_ros.core.lubrication.model import LubricationModel
from seal_friction_ros.core.oring_contact.compliance import SlidingFace, sliding_face
from seal_friction_ros.core.oring_contact.equilibrium import OringModel
from seal_friction_ros.core.oring_contact.loading import LoadedRing, loaded_states, oring_model
from seal_friction_ros.core.oring_contact.oring_case import OringCase
from seal_friction_ros.core.oring_contact.results import evaluate_contact
from seal_friction_ros.core.oring_contact.surroundings import GLAND, ROD

_MARGIN = 0.25  # of the contact width, beyond each of its edges
FILM_CROWDING = -0.4  # of the elements, see `mesh`: small ones towards both walls of the groove
_LEAST_PRESSURE = 1e-6  # of E*: of the asperities where the dry ring does not touch, at the start


class OringFilm(NamedTuple):
    """A ring under pressure, ready for the film."""

    model: LubricationModel
    start: ContactState  # at rest, the fluid up to the peak of the contact stress
    axial_stiffness: float  # axial force on the contact over its displacement [N/m]


def oring_films(case: LubricationCase, oring: OringCase, pressures: tuple[float, ...]) -> Iterator[OringFilm]:
    """Ring of a case under increasing fluid pressures [Pa] on its left.

    ValueError: the ring does not fit or does not seal; NotConvergedError: the finite elements did not converge.
    """
    elements = oring_model(oring, FILM_CROWDING)
    for loaded in loaded_states(oring, elements, pressures):
        yield _film(case, oring, elements, loaded)


def oring_film(case: LubricationCase, oring: OringCase, pressure: float) -> OringFilm:
    """Ring of a case under one pressure, as of `oring_films`."""
    return next(oring_films(case, oring, (pressure,)))


def _film(case: LubricationCase, oring: OringCase, elements: OringModel, loaded: LoadedRing) -> OringFilm:
    geometry, found, pressure = oring.geometry, evaluate_contact(elements, loaded), loaded.pressure
    on_rod = geometry.sliding_wall == 'rod'
    dry = found.rod if on_rod else found.gland
    face = flat_part(sliding_face(elements, loaded, ROD if on_rod else GLAND))
    begin = max(dry.edges[0] - _MARGIN * dry.width, float(face.place[0]))
    end = min(dry.edges[1] + _MARGIN * dry.width, float(face.place[-1]))
    cells = case.numerics.cells
    place = begin + (np.arange(cells) + 0.5) * (end - begin) / cells
    circumference = math.pi * (geometry.rod_diameter if on_rod else geometry.gland_diameter)
    modulus = 4.0 / 3.0 * oring.rubber.modulus  # E / (1 - 1/4)
    body = condensed_body(place, face.place, face.compliance, modulus, circumference)
    at_ends = np.interp((begin, end), face.place, face.pressure)
    inside = (face.place >= begin) & (face.place <= end)
    excess = np.where(inside, face.pressure - np.interp(face.place, (begin, end), at_ends), 0.0)
    spans = np.diff(face.place, prepend=face.place[0], append=face.place[-1])
    areas = 0.5 * circumference * (spans[:-1] + spans[1:])
    unpressed = CubicSpline(face.place, face.gap - face.compliance @ (areas * excess))(place)
    dry_pressure: FloatArray = PchipInterpolator(face.place, face.pressure)(place)
    ambient = np.where(np.arange(cells) < int(dry_pressure.argmax()), pressure, 0.0)
    contact = LubricatedContact(body, case.topography, case.grease)
    profile = unpressed - body.deflection(np.interp(place, (begin, end), at_ends))
    model = LubricationModel(case, contact, place, ambient, profile, circumference, pressure, 0.0)
    solid = np.maximum(dry_pressure - ambient, _LEAST_PRESSURE * modulus)
    length, stiffness = case.topography.separation_length, case.topography.contact_stiffness(modulus)
    guess = np.maximum(np.interp(place, face.place, face.gap), 0.0) + length * np.log1p(stiffness / solid)
    gap = dry_contact(contact, model.profile + body.deflection(ambient), guess)
    return OringFilm(model, ContactState(gap, ambient, np.ones(cells)), face.axial_stiffness)


def flat_part(face: SlidingFace) -> SlidingFace:
    """The part of a face about the peak of its pressure that is less steep than 45 degrees."""
    steep, peak = np.flatnonzero(np.abs(np.diff(face.gap)) > np.diff(face.place)), int(face.pressure.argmax())
    first, last = max(steep[steep < peak] + 1, default=0), min(steep[steep >= peak], default=len(face.gap) - 1)
    part = slice(first, last + 1)
    return face._replace(
        place=face.place[part], gap=face.gap[part], pressure=face.pressure[part], compliance=face.compliance[part, part]
    )

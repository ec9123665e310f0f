r"""The film under a finite-element O-ring: how the ring rests on the wall, and how it gives way to the film.

The ring is first pressed on a dry rod or bore (`oring_contact`, finite strain). Film and asperities then change the
pressure on its face, and the gap follows linearly about that state,

.. math:: h = g_0 + K\,(p + p_c(h) - q_0)

with gap g_0 and pressure q_0 of the dry ring, and the compliance K of `elasticity.condensed_body`. The film reaches a
quarter of the contact width beyond both edges of the contact, as far as the elements that face the wall do (our
choice). Under a high pressure that is the wall of the groove, where the face turns away from one node to the next.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.lubrication.contact import ContactState, LubricatedContact, dry_contact
from seal_friction_ros.core.lubrication.elasticity import condensed_body
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase
from seal_friction_ros.core.lubrication.model import LubricationModel
from seal_friction_ros.core.oring_contact.compliance import SlidingFace, sliding_face
from seal_friction_ros.core.oring_contact.loading import loaded_states, oring_model
from seal_friction_ros.core.oring_contact.oring_case import OringCase
from seal_friction_ros.core.oring_contact.results import evaluate_contact
from seal_friction_ros.core.oring_contact.surroundings import GLAND, ROD

_MARGIN = 0.25  # of the contact width, beyond each of its edges
_LEAST_PRESSURE = 1e-6  # of E*: of the asperities where the dry ring does not touch, at the start


class OringFilm(NamedTuple):
    """A ring under pressure, ready for the film."""

    model: LubricationModel
    start: ContactState  # at rest, the fluid up to the peak of the contact stress
    axial_stiffness: float  # axial force on the contact over its displacement [N/m]


def oring_film(case: LubricationCase, oring: OringCase, pressure: float) -> OringFilm:
    """Ring of a case under a fluid ``pressure`` [Pa] on its left.

    ValueError: the ring does not fit or does not seal; NotConvergedError: the finite elements did not converge.
    """
    elements = oring_model(oring)
    loaded = next(loaded_states(oring, elements, (pressure,)))
    geometry, found = oring.geometry, evaluate_contact(elements, loaded)
    on_rod = geometry.sliding_wall == 'rod'
    face, dry = sliding_face(elements, loaded, ROD if on_rod else GLAND), found.rod if on_rod else found.gland
    begin = max(dry.edges[0] - _MARGIN * dry.width, float(face.place[0]))
    end = min(dry.edges[1] + _MARGIN * dry.width, float(face.place[-1]))
    cells = case.numerics.cells
    place = begin + (np.arange(cells) + 0.5) * (end - begin) / cells
    circumference = math.pi * (geometry.rod_diameter if on_rod else geometry.gland_diameter)
    modulus = 4.0 / 3.0 * oring.rubber.modulus  # E / (1 - 1/4)
    body = condensed_body(place, face.place, face.compliance, modulus, circumference)
    dry_gap: FloatArray = _gap(face, place)
    dry_pressure: FloatArray = PchipInterpolator(face.place, face.pressure)(place)
    ambient = np.where(np.arange(cells) < int(dry_pressure.argmax()), pressure, 0.0)
    contact = LubricatedContact(body, case.topography, case.grease)
    profile = dry_gap - body.deflection(dry_pressure)
    model = LubricationModel(case, contact, place, ambient, profile, circumference, pressure, 0.0)
    solid = np.maximum(dry_pressure - ambient, _LEAST_PRESSURE * modulus)
    stiffness, length, _ = contact.asperities
    guess = np.maximum(dry_gap, 0.0) + length * np.log1p(stiffness / solid)
    gap = dry_contact(contact, model.profile + body.deflection(ambient), guess)
    return OringFilm(model, ContactState(gap, ambient, np.ones(cells)), face.axial_stiffness)


def _gap(face: SlidingFace, place: FloatArray) -> FloatArray:
    """Gap of the dry face [m]: a cubic spline, and linear from where it is steeper than 45 degrees: no overshoot."""
    steep, peak = np.flatnonzero(np.abs(np.diff(face.gap)) > np.diff(face.place)), int(face.pressure.argmax())
    first, last = max(steep[steep < peak] + 1, default=0), min(steep[steep >= peak], default=len(face.gap) - 1)
    gap = np.interp(place, face.place, face.gap)
    smooth = (place >= face.place[first]) & (place <= face.place[last])
    gap[smooth] = CubicSpline(face.place[first : last + 1], face.gap[first : last + 1])(place[smooth])
    return gap

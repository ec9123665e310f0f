"""Measured and computed points of the thesis in SI, from ``data/thesis``."""

import csv
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import INCH, LBF, PSI
from seal_friction_ros.files import share_directory
from seal_friction_ros.offline.bags.import_thesis import read_pulls

THESIS_SEAL = 'ms28775_114'  # names of seals and cases that are compared with the thesis start with this


class ThesisContact(NamedTuple):
    """Contact stress at one pressure, one of Figures B-7 to B-11 of the thesis."""

    normal_force: float  # [N] sum over the cells
    peak_stress: float  # [Pa]
    width: float  # [m]
    position: FloatArray  # [m] of the cells, from the upstream end of the contact
    stress: FloatArray  # [Pa]


def thesis_columns(table: str, **units: float) -> list[FloatArray]:
    """Columns of a table of the thesis in SI, in the order of ``units``: column name -> size of its unit."""
    path = share_directory('seal_friction_ros', __file__) / 'data' / 'thesis' / f'{table}.csv'
    with path.open(newline='', encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    return [np.array([float(row[name]) for row in rows]) * unit for name, unit in units.items()]


def dynamic_readings() -> tuple[FloatArray, FloatArray]:
    """Pressure [Pa, gauge] and running friction of both seals [N] of the 66 readings of Tables A-1 to A-3."""
    pulls = read_pulls()
    return np.array([pull.pressure for pull in pulls]), np.array([pull.dynamic_friction for pull in pulls])


def mean_dynamic_friction() -> tuple[FloatArray, FloatArray]:
    """Each pressure of `dynamic_readings` [Pa, gauge], and the mean friction of both seals at it [N]."""
    pressure, friction = dynamic_readings()
    levels = np.unique(pressure)
    return levels, np.array([friction[pressure == level].mean() for level in levels])


def appendix_b() -> dict[float, ThesisContact]:
    """Contact of the seal of the thesis by pressure [psi]: Appendix B and Table 4."""
    of_cell, position, stress, force = thesis_columns(
        'fea_contact_stress', pressure_psig=1.0, node_position_in=INCH, contact_stress_psi=PSI, cell_force_lbf=LBF
    )
    pressures, widths = thesis_columns('normal_force', pressure_psig=1.0, contact_length_in=INCH)
    contacts = {}
    for pressure, width in zip(pressures.tolist(), widths.tolist(), strict=True):
        at = of_cell == pressure
        contacts[pressure] = ThesisContact(
            float(force[at].sum()), float(stress[at].max()), width, position[at], stress[at]
        )
    return contacts

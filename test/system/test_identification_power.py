"""The campaign of known seals, with one draw a case."""

import pytest
from system.identification_power import campaign


@pytest.mark.long  # `core/identification/test_fitting.py` holds the same for fewer cases
def test_no_flat_law_where_friction_rises_by_four_standard_errors():
    rows = campaign(1, workers=2)
    assert len(rows) == 54
    assert not any(wrong for _, wrong in rows)

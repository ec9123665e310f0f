"""The feed-forward with fitted elasticity, on a plant of the same kind and on a structurally different one."""

import pytest
from system.elastic_seals import PLANTS, identified, result


@pytest.mark.parametrize(('plant', 'less'), [('elements, 4e5 N/m', 0.80), ('LuGre, 3e5 N/m', 0.65)])
@pytest.mark.long  # `core/tuning/test_other_plants.py` has a shorter form
def test_the_elastic_feed_forward_reduces_the_tracking_error(plant, less):
    found = result(PLANTS[plant], identified(PLANTS[plant]).presliding)
    assert found.elastic < (1.0 - less) * found.without
    assert max(found.softer, found.stiffer) < 0.4 * found.without
    assert found.elastic < 0.5 * found.rigid

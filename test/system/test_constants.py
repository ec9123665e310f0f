"""The campaign of the constants finds them all, and what one moves."""

from system.constants import constants, figures, moved

from seal_friction_ros.core.estimation import friction_filter

SECONDS = 4.0  # of an attack: enough for the filter to have learnt


def test_a_constant_of_the_filter_moves_what_it_says_and_is_itself_again():
    each = {(one.name, one.factor): one for one in constants()}
    assert {('LEAST_NOISE', 0.5), ('MISFIT', 2.0), ('IMPLAUSIBLE', 0.5), ('STEP_READINGS', 2.0)} <= set(each)
    usual, before = figures(SECONDS, {}), friction_filter.LEAST_NOISE
    assert 'good' in moved(SECONDS, {}, usual, each['IMPLAUSIBLE', 0.5])  # less is explained
    assert moved(SECONDS, {}, usual, each['LEAST_NOISE', 0.5]._replace(factor=1.0)) == '-'
    assert before == friction_filter.LEAST_NOISE

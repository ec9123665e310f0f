"""What the estimator says about its inputs: what it waits for, when one stops, when it is back."""

import itertools

from harness.live_graph import graph

from seal_friction_ros.nodes.input_watch import InputWatch

SECOND = 10**9  # [ns]


def watch(*needed: str) -> InputWatch:
    return InputWatch(needed, 0.0, lambda name: f'nobody publishes /{name}')


def texts(remarks) -> list[str]:
    return [remark.text for remark in remarks]


def test_an_input_that_never_came_is_waited_for_after_2_s_and_named_again_after_30_s():
    inputs = watch('a', 'b')
    assert inputs.look({'a': 1, 'b': 0}, 1.5) == []
    assert texts(inputs.look({'a': 400, 'b': 0}, 2.0)) == ['waiting for b (nobody publishes /b)']
    said = [texts(inputs.look({'a': 400 + 100 * i, 'b': 0}, 2.0 + 0.5 * i)) for i in range(1, 61)]
    assert said == [[]] * 59 + [['waiting for b (nobody publishes /b)']]
    assert texts(inputs.look({'a': 9000, 'b': 1}, 32.5)) == ['every input that is needed has arrived']


def test_an_input_that_is_not_needed_is_not_waited_for():
    assert watch('a').look({'a': 1, 'optional': 0}, 10.0) == []


def test_an_input_that_stops_is_named_once_and_again_when_it_is_back():
    inputs = watch('a')
    for i in range(1, 11):
        assert inputs.look({'a': 500 * i}, 0.5 * i) == []
    assert inputs.look({'a': 5000}, 5.9) == []
    (stopped,) = inputs.look({'a': 5000}, 6.1)
    assert stopped.text == 'a has stopped: no message for 1.1 s; nobody publishes /a'
    assert stopped.is_warning
    assert inputs.look({'a': 5000}, 7.0) == []
    assert texts(inputs.look({'a': 5100}, 8.0)) == ['a is back after 3.0 s']


def test_a_slow_input_has_not_stopped_between_two_messages():
    """A temperature every 4 s: five periods pass before it counts as stopped."""
    inputs = watch('a')
    for i in range(1, 100):
        assert inputs.look({'a': 1 + i // 8}, 0.5 * i) == [], i
    assert texts(inputs.look({'a': 13}, 48.0 + 17.0)) == []
    assert texts(inputs.look({'a': 13}, 48.0 + 20.0))[0].startswith('a has stopped')


def test_the_node_names_what_it_waits_for_on_its_terminal_and_what_stops(capfd):
    with graph() as g:
        said = ''

        def has_said(*words: str) -> bool:
            nonlocal said
            said += capfd.readouterr().err
            return all(word in said for word in words)

        assert g.spin_until(lambda: has_said('waiting for cylinder_pressure (/probe publishes /cylinder_pressure'))
        g.connect()
        stamps = itertools.count(SECOND, 10**7)

        def has_said_while_inputs_come(words: str) -> bool:
            g.estimate(next(stamps), 0.1)
            return has_said(words)

        assert g.spin_until(lambda: has_said_while_inputs_come('every input that is needed has arrived'))
        assert g.spin_until(lambda: has_said('rod_velocity has stopped', 'cylinder_pressure has stopped'))
        assert g.spin_until(lambda: has_said_while_inputs_come('rod_velocity is back after'))

"""The view of a bag shows at each moment what had come until then."""

import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest
from harness.browser import chromium
from harness.closed_loop_bags import START, write_closed_loop
from harness.example_bags import read_whole, rewrite, write_inputs, write_recorded
from harness.monitor_process import shown
from harness.page_in_browser import violations
from mcap.reader import make_reader
from paths import ROOT

from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.coder import decode, encode
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, PRESSURE_TYPE
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.offline.bags.bag import BagError, BagMessage, BagWriter, read_messages
from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_ros.offline.monitor.actuator_view import COLUMNS, serious_words
from seal_friction_ros.offline.monitor.recorded_view import RecordedView
from seal_friction_ros.offline.monitor.server import MonitorServer


@pytest.fixture(scope='module')
def loop(tmp_path_factory) -> Path:
    return write_closed_loop(tmp_path_factory.mktemp('bags') / 'loop', seconds=1.0)


def column(view: RecordedView, name: str, since: float = -1.0, until: float = 1e9) -> np.ndarray:
    rows = view.view('', since, until)['rows']
    return np.array([np.nan if one[COLUMNS.index(name)] is None else one[COLUMNS.index(name)] for one in rows])


@pytest.mark.parametrize(
    ('name', 'attribute', 'unit'),
    [
        ('estimate', 'friction_force', 1.0),
        ('feedforward', 'feedforward_force', 1.0),
        ('pressure_a', 'pressure_a', 1e5),
        ('pressure_b', 'pressure_b', 1e5),
        ('measured', 'force_sum', 1.0),
    ],
)
def test_a_curve_is_what_another_reader_finds_in_the_bag(loop: Path, name: str, attribute: str, unit: float):
    """Each row has the newest number that had come: those of the bag come every millisecond, the rows every ten."""
    run, view = read_run(loop), read_whole(RecordedView(loop))
    times, values = column(view, 'time'), column(view, name)
    given = np.asarray(getattr(run, attribute)) / unit
    newest = np.searchsorted(run.time, times - 1e-6, side='right') - 1
    near = np.stack([given[np.clip(newest + shift, 0, len(given) - 1)] for shift in (-1, 0, 1)])
    off = np.min(np.abs(near - values), axis=0)
    assert len(times) == pytest.approx(200, abs=2)
    assert np.nanmax(off) <= 1e-5 * np.nanmax(np.abs(given)) + 1e-9
    assert np.ptp(values) > 0.0


def test_the_tracking_error_is_reference_less_position(loop: Path):
    run, view = read_run(loop), read_whole(RecordedView(loop))
    assert np.nanmax(np.abs(column(view, 'error'))) == pytest.approx(
        1e6 * np.max(np.abs(run.reference - run.position)), rel=0.05
    )


def test_a_window_has_the_rows_in_it_and_the_words_of_its_end(loop: Path):
    view = read_whole(RecordedView(loop))
    frame = view.view('', 0.4, 0.9)
    times = [one[0] for one in frame['rows']]
    assert times[0] == pytest.approx(0.4, abs=0.011)
    assert times[-1] == pytest.approx(0.9)
    assert frame['now']['settings']['scale'] == 0.0
    assert view.view('', 1.0, 1.9)['now']['settings']['scale'] == 0.9  # changed live, after a second


def test_faults_are_named_when_they_are_there_and_not_later():
    view = read_whole(RecordedView(ROOT / 'bags' / 'faults'))
    duration = view.describe()['duration']
    words = [view.view('', at, at)['now']['faults'] for at in np.arange(0.1, duration, 0.1)]
    named = {fault for moment in words for fault in moment}
    assert any('pressure is not a finite number' in fault for fault in named)
    assert any('force sum jumps' in fault or 'force sum is beyond' in fault for fault in named)
    assert any(not [fault for fault in moment if 'usual' not in fault] for moment in words)


def test_a_bag_says_where_its_first_estimate_is_and_where_its_faults_are(tmp_path: Path):
    """Two seconds of inputs alone, then a bag with faults: the page opens at the first estimate."""
    source = ROOT / 'bags' / 'faults'
    messages = list(read_messages(source))
    pressure = next(message for message in messages if message.type_name == PRESSURE_TYPE)
    with BagWriter(tmp_path / 'late') as writer:
        writer.write(*pressure._replace(log_time=messages[0].log_time))
        for message in messages:
            writer.write(*message._replace(log_time=message.log_time + 2 * 10**9))
    about, late = read_whole(RecordedView(source)).describe(), read_whole(RecordedView(tmp_path / 'late')).describe()
    assert late['first'] == pytest.approx(about['first'] + 2.0, abs=0.03)
    ((label, faults),) = about['faults'].items()
    assert any('pressure is not a finite number' in words for _, _, words in faults)
    assert len(faults) < 200
    view = read_whole(RecordedView(source))
    marked = [any(begin <= at <= end for begin, end, _ in faults) for at in np.arange(0.5, about['duration'], 0.01)]
    rows = view.view(label, -1.0)['rows']
    serious = [one[0] for one in rows if serious_words(one[-2])]
    assert all(any(begin <= at <= end for begin, end, _ in faults) for at in serious)
    assert not all(marked)


def test_a_stretch_without_estimates_is_a_fault(tmp_path: Path):
    recorded = write_recorded(tmp_path)

    def without(_: int, message: BagMessage) -> BagMessage | None:
        return None if 2.0e9 < message.log_time < 3.0e9 and message.type_name == ESTIMATE_TYPE else message

    view = read_whole(RecordedView(rewrite(recorded, tmp_path / 'gap', without)))
    (faults,) = view.describe()['faults'].values()
    rows = view.view('', -1.0)['rows']  # from 1 s of the bag on
    missing = [one[COLUMNS.index('estimate')] for one in rows if 1.05 < one[0] < 1.95]
    assert missing == [None] * len(missing) != []
    assert any('no estimate' in words and begin <= 1.55 and end >= 1.95 for begin, end, words in faults)
    (faults,) = read_whole(RecordedView(recorded)).describe()['faults'].values()
    assert not any('no estimate' in words for _, _, words in faults)


def test_what_is_before_the_start_and_after_the_end_is_the_nearest_moment(loop: Path):
    view = read_whole(RecordedView(loop))
    assert view.view('', -5.0, -1.0)['rows']
    assert view.view('', 1e6, 1e6)['time'] == view.describe()['duration']


def test_a_long_bag_has_no_more_rows_than_fit(loop: Path, monkeypatch):
    monkeypatch.setattr('seal_friction_ros.offline.monitor.recorded_view.MOST_ROWS', 50)
    view = read_whole(RecordedView(loop))
    assert 45 <= len(column(view, 'time')) <= 52
    assert column(view, 'time')[-1] == pytest.approx(view.describe()['duration'], abs=0.05)


def test_a_fault_of_one_estimate_is_marked_however_far_the_rows_are_apart(tmp_path: Path, monkeypatch):
    """Of 3000 estimates one has a fault; a row holds 60 of them."""
    bag = write_closed_loop(tmp_path / 'loop', (0.0,), seconds=3.0)
    place = next(number for number, message in enumerate(read_messages(bag)) if message.log_time > START + 2 * 10**9)

    def once(number: int, message: BagMessage) -> BagMessage:
        if message.type_name != ESTIMATE_TYPE or not place <= number < place + 7:
            return message
        estimate = decode(ESTIMATE_TYPE, message.data)
        return message._replace(data=encode(estimate._replace(status=int(Status.FORCE_NOT_FINITE))))

    monkeypatch.setattr('seal_friction_ros.offline.monitor.recorded_view.MOST_ROWS', 50)
    (faults,) = read_whole(RecordedView(rewrite(bag, tmp_path / 'fault', once))).describe()['faults'].values()
    ((begin, end, words),) = faults
    assert begin - 0.06 <= 2.0 <= end
    assert words == 'the force sum is not a finite number'


def test_a_bag_is_shown_from_its_first_estimate_on_while_the_rest_is_read(loop: Path):
    view, whole = RecordedView(loop), read_whole(RecordedView(loop)).view('', -1.0, 1.0)
    about = view.describe()
    assert about['first'] <= about['loaded'] < 0.2 < about['duration']
    early = view.view('', -1.0, 1.0)
    assert early['time'] == about['loaded']
    assert early['rows'] == whole['rows'][: len(early['rows'])] != []
    read_whole(view)
    assert view.describe()['loaded'] == about['duration']
    assert view.view('', -1.0, 1.0) == whole


@pytest.mark.skipif(not chromium(), reason='no Chromium: apt-get install chromium')
def test_the_page_shows_how_far_a_bag_has_been_read_and_follows(loop: Path):
    view, drawn, may_read = RecordedView(loop), 'byId("friction-curve").getBBox().width', threading.Event()
    server = MonitorServer(view, work=slices_after(may_read, view))
    server.start()
    try:
        with shown(server.url, 1400) as page:
            page.wait_for('byId("clock").textContent.includes("read to") && columns.time.length')
            assert page.value('columns.time.at(-1)') <= view.describe()['loaded']
            early = page.value(drawn)
            may_read.set()
            page.wait_for('!byId("clock").textContent.includes("read to")')
            assert page.value(drawn) > 900.0 > early
    finally:
        server.stop()


@pytest.mark.skipif(not chromium(), reason='no Chromium: apt-get install chromium')
def test_the_view_of_a_bag_is_for_people_without_a_mouse_too():
    view = read_whole(RecordedView(ROOT / 'bags' / 'faults'))
    server = MonitorServer(view)
    server.start()
    try:
        with shown(server.url, 1400) as page:
            page.wait_for('byId("marks").children.length && columns.time.length')
            assert violations(page) == []
    finally:
        server.stop()


def slices_after(event: threading.Event, view: RecordedView) -> Iterator[None]:
    """The rest of a bag, once an event is set."""
    while not event.wait(0.001):
        yield
    yield from view.read()


@pytest.mark.skipif(not chromium(), reason='no Chromium: apt-get install chromium')
def test_a_page_that_asks_on_is_told_why_it_is_refused(loop: Path):
    view = RecordedView(loop)
    server = MonitorServer(view, work=slices_after(threading.Event(), view))
    server.start()
    try:
        with shown(server.url, 1400) as page:
            page.wait_for('byId("clock").textContent.includes("read to")')
            server.token = server.token[::-1]
            page.wait_for('byId("reason").textContent.includes("of an earlier monitor")')
            assert page.value('byId("verdict-word").textContent') == 'refused'
    finally:
        server.stop()


def test_damage_ends_what_is_shown_and_the_verdict_says_so(tmp_path: Path):
    shutil.copytree(ROOT / 'bags' / 'pull_test', damaged := tmp_path / 'pull_test')
    (file,) = damaged.glob('*.mcap')
    with file.open('rb') as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    chunk = chunks[len(chunks) // 2]
    content = bytearray(file.read_bytes())
    content[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 255
    file.write_bytes(content)
    view = read_whole(RecordedView(damaged))
    now = view.view('', -1.0)['now']
    assert now['verdict'] == 'bad'
    assert now['reason'].startswith('not read to its end')
    assert now['next'] == f'save the rest: seal_friction recover {damaged}'


def test_a_file_that_is_gone_is_not_to_be_recovered(tmp_path: Path):
    with BagWriter(tmp_path / 'split', split_duration=1.0) as writer:
        for message in read_messages(ROOT / 'bags' / 'pull_test'):
            writer.write(*message)
    view = RecordedView(tmp_path / 'split')
    max(tmp_path.glob('split/*.mcap')).unlink()
    now = read_whole(view).view('', -1.0)['now']
    assert (now['verdict'], now['next']) == ('bad', 'mend what it names: what comes after it is not shown')


def test_the_overview_has_the_friction_and_the_reversals_of_the_whole_bag(loop: Path):
    run = read_run(loop)
    view = read_whole(RecordedView(loop))
    ((_, overview),) = view.describe()['overview'].items()
    forces = column(view, 'estimate')
    time, low, high = np.array(overview['curve'], float).T
    assert np.all(np.diff(time) > 0.0)
    assert np.nanmax(high) == np.nanmax(forces) > 0.0
    assert np.nanmin(low) == np.nanmin(forces) < 0.0
    sliding = run.direction[run.state == FrictionState.SLIDING]
    assert len(overview['reversals']) == np.count_nonzero(np.diff(sliding))


def test_a_bag_without_estimates_is_refused_with_what_to_do(tmp_path: Path):
    with pytest.raises(BagError, match='seal_friction replay'):
        RecordedView(write_inputs(tmp_path / 'inputs', 20))


@pytest.mark.parametrize('path', ['change', 'off', 'lift'])
def test_a_bag_cannot_be_changed(tmp_path: Path, path: str):
    server = MonitorServer(RecordedView(write_recorded(tmp_path)))
    server.start()
    try:
        head = {'Content-Type': 'application/json'}
        request = Request(server.url.replace('/?', f'/{path}?'), data=b'{}', headers=head)  # noqa: S310  our own server
        with pytest.raises(HTTPError) as refused:
            urlopen(request)  # noqa: S310
        assert (refused.value.code, refused.value.read()) == (400, b'this is a recording: nothing is changed')
    finally:
        server.stop()

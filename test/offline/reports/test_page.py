"""The page kit: values escaped, missing values refused, files written whole."""

import re

import pytest
from harness.report_page import Page, checked_page
from jinja2 import UndefinedError
from matplotlib.figure import Figure
from paths import ROOT

from seal_friction_ros.core.estimation.findings import GOOD, LOOK, Verdict
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.files import package_version
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.reports import page as kit
from seal_friction_ros.offline.reports.figure_style import Plot, house_style, new_figure
from seal_friction_ros.offline.reports.page import (
    MOST_OPEN,
    PARAMETER_HEADS,
    TEMPLATES,
    Head,
    Table,
    environment,
    parameter_rows,
    render_page,
    write_page,
)

OFFLINE = TEMPLATES.parents[1]
EVIL = '<script>alert("1")</script>&\''
FROM = {'verdict': Verdict(GOOD, 'fine'), 'head': Head('seal_friction report bag'), 'warnings': []}
PARTS = {'base', 'macros', 'lubrication', 'uncertainty'}
PAGES = sorted(path.stem for path in TEMPLATES.glob('*.html') if path.stem not in PARTS)
EVERYTHING = """{% extends 'base.html' %}{% from 'macros.html' import figure, notes, table, tile with context %}
{% block title %}{{ name }}{% endblock %}{% block body %}{{ tile(name, name) }}{{ notes([name]) }}
{% call figure('shown') %}{{ name }} and "quoted" text{% endcall %}{% call figure('absent') %}{{ missing }}{% endcall %}
{{ table(rows) }}{% endblock %}"""


@pytest.fixture
def everything(tmp_path, monkeypatch):
    """Name of a template that has every part, in a folder beside copies of the parts."""
    for part in ('base.html', 'macros.html', 'figures.js'):
        (tmp_path / part).write_text((TEMPLATES / part).read_text())
    (tmp_path / 'everything.html').write_text(EVERYTHING)
    monkeypatch.setattr(kit, 'TEMPLATES', tmp_path)
    environment.cache_clear()
    yield 'everything'
    environment.cache_clear()


def plot(name='shown') -> Plot:
    with house_style():
        figure, ax = new_figure(EVIL, 3.0)
        ax.plot([0.0, 1.0], [0.0, 1.0], label=EVIL)
        ax.legend()
    assert isinstance(figure, Figure)
    return Plot(name, figure)


def test_every_value_is_escaped_and_read_back_unchanged(everything, tmp_path):
    rows = Table((EVIL, 'number'), [(EVIL, 1)], (0,))
    head = Head(EVIL, (EVIL,))
    given = {'verdict': Verdict(LOOK, EVIL, EVIL), 'head': head, 'warnings': [EVIL] * 5}
    write_page(tmp_path / 'out' / 'page.html', everything, [plot()], **given, name=EVIL, rows=rows)
    page = checked_page(tmp_path / 'out' / 'page.html')
    assert page.texts['title'] == page.texts['h1'] == page.texts['code'] == [EVIL]
    assert page.texts['p.note'] == [EVIL] * 6  # one more in the body
    assert page.texts['p.said'] == [f'Look: {EVIL}']
    assert page.texts['p.next'] == [f'Next: {EVIL}']
    assert page.tiles == {EVIL: EVIL}
    assert page.table(EVIL) == [{EVIL: EVIL, 'number': '1'}]
    assert page.texts['figcaption'] == [f'{EVIL} and "quoted" text']
    assert page.texts['td.text'] == [EVIL]
    assert page.texts['td'] == ['1']


def test_a_figure_that_was_not_drawn_is_left_out_with_its_caption(everything, tmp_path):
    write_page(tmp_path / 'page.html', everything, [], **FROM, name='x', rows=Table((), ()))
    assert Page(tmp_path / 'page.html').figures == []


@pytest.mark.parametrize('name', PAGES)
def test_a_template_is_strict_about_missing_values(name):
    with pytest.raises(UndefinedError):
        render_page(name, {}, {})


def test_every_template_belongs_to_a_report():
    sources = ''.join(path.read_text() for room in ('reports', 'commands') for path in (OFFLINE / room).glob('*.py'))
    assert sorted({*re.findall(r"write_(?:case_)?page\(\s*(?:out|page),\s*'(\w+)'", sources)}) == PAGES


def test_the_templates_are_installed():
    assert re.search(
        r"offline\.reports': \['templates/\*\.html', 'templates/\*\.js'\]", (ROOT / 'setup.py').read_text()
    )


def test_parameters_come_with_unit_and_meaning():
    rows = parameter_rows(Sine(amplitude=0.001, frequency=1.0 / 3.0), 'wave.')
    assert [len(row) for row in rows] == [len(PARAMETER_HEADS)] * len(rows)
    assert rows[0][:3] == ('wave.amplitude', '0.001', 'm')
    assert rows[1][:3] == ('wave.frequency', '0.3333333333', 'Hz')
    assert all(row[3] for row in rows)


def test_a_page_that_is_there_is_replaced_and_one_that_cannot_be_written_is_one_clear_line(everything, tmp_path):
    values = {**FROM, 'name': 'x', 'rows': Table((), ())}
    (tmp_path / 'page.html').write_text('old')
    assert write_page(tmp_path / 'page.html', everything, [], **values) == ()
    assert (tmp_path / 'page.html').read_text().startswith('<!DOCTYPE html>')
    with pytest.raises(ValueError, match='cannot write') as error:
        write_page(tmp_path / 'page.html' / 'page.html', everything, [plot()], **values)
    assert '\n' not in str(error.value)


def test_a_tile_breaks_a_long_name_at_its_underscores_only(everything):
    """Inside a tile a name like that of a law is neither cut off nor broken inside a word."""
    made = render_page(
        everything, {}, {}, **FROM, name='pressure_power_law_2_3_asymmetric', missing='', rows=Table((), ())
    )
    assert '<div class="tile name"><b>pressure_<wbr>power_<wbr>law_<wbr>2_<wbr>3_<wbr>asymmetric</b>' in made
    assert 'minmax(min(10.5rem, 100%), 1fr)' in made
    plain = render_page(everything, {}, {}, **FROM, name='12 bar', missing='', rows=Table((), ()))
    assert '<div class="tile"><b>12 bar</b>' in plain


def test_at_most_three_remarks_are_open(everything, tmp_path):
    remarks = [f'remark {i}' for i in range(8)]
    values = {**FROM, 'warnings': remarks, 'name': 'x', 'rows': Table((), ())}
    write_page(tmp_path / 'page.html', everything, [], **values)
    page = Page(tmp_path / 'page.html')
    assert page.texts['summary'] == ['5 more remarks']
    assert [text for text in page.texts['details'][0].split('remark ') if text[:1] in '34567'] != []
    assert len(page.texts['p.note']) == 8 + 1
    assert MOST_OPEN == 3


def test_a_page_says_which_command_made_it_as_typed(tmp_path, capsys):
    page = tmp_path / 'charts.html'
    assert main(['charts', 'ms28775_114', '--out', str(page)]) == 0
    assert f'seal_friction charts ms28775_114 --out {page}' in page.read_text()
    assert f'version {package_version()}' in page.read_text()
    capsys.readouterr()

"""The layouts for Foxglove and PlotJuggler show what the nodes publish: every topic and every field is there."""

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from paths import ROOT

from seal_friction_ros.core.messages.layouts import INPUTS, OUTPUTS
from seal_friction_ros.nodes.managed_node import message_class

LAYOUTS = ROOT / 'config' / 'layouts'
TYPES = {f'/{topic}': kind for topic, kind in {**INPUTS, **OUTPUTS}.items()}
SHOWN = {
    '/force_sum': {'force'},
    '/friction_estimate': {'friction_force', 'adaptation_scale', 'residual', 'state', 'status'},
    '/friction_feedforward': {'force', 'limited'},
    '/cylinder_pressure': {'chamber_a', 'chamber_b'},
    '/servo_reference': {'position'},
    '/rod_position': {'position'},
}
"""What a person looks for in a layout, whatever else is in it."""


def foxglove() -> dict[str, Any]:
    return json.loads((LAYOUTS / 'foxglove.json').read_text())


def plotjuggler() -> ElementTree.Element:
    return ElementTree.parse(LAYOUTS / 'plotjuggler.xml').getroot()  # noqa: S314  our own file


def foxglove_paths() -> list[tuple[str, str]]:
    panels = foxglove()['configById'].values()
    return [tuple(path['value'].split('.', 1)) for panel in panels for path in panel.get('paths', ())]


def plotjuggler_paths() -> list[tuple[str, str]]:
    root = plotjuggler()
    made = {snippet.get('name') for snippet in root.iter('snippet')}
    names = [curve.get('name') for curve in root.iter('curve')]
    assert made <= set(names)
    sources = [element.text for tag in ('linked_source', 'v1') for element in root.iter(tag)]
    return [tuple(name.rsplit('/', 1)) for name in [*names, *sources] if name not in made]


PATHS = {'foxglove.json': foxglove_paths, 'plotjuggler.xml': plotjuggler_paths}


@pytest.mark.parametrize('file', PATHS)
def test_every_topic_and_field_exists(file: str):
    for topic, field in PATHS[file]():
        fields = message_class(TYPES[topic]).get_fields_and_field_types()
        assert re.fullmatch(r'double|u?int\d+', fields[field]), f'{topic} {field}'


@pytest.mark.parametrize('file', PATHS)
def test_it_shows_what_a_person_looks_for(file: str):
    shown: dict[str, set[str]] = {}
    for topic, field in PATHS[file]():
        shown.setdefault(topic, set()).add(field)
    for topic, fields in SHOWN.items():
        assert fields <= shown[topic]


def test_every_panel_of_foxglove_is_in_its_arrangement_once():
    def panels(part: Any) -> list[str]:
        return [part] if isinstance(part, str) else [*panels(part['first']), *panels(part['second'])]

    document = foxglove()
    assert sorted(panels(document['layout'])) == sorted(document['configById'])
    assert any(panel.get('topicToRender') == '/diagnostics' for panel in document['configById'].values())


def test_the_sizes_of_plotjuggler_are_those_of_its_areas():
    for splitter in plotjuggler().iter('DockSplitter'):
        sizes = [float(size) for size in splitter.get('sizes').split(';')]
        assert len(sizes) == len(list(splitter)) == int(splitter.get('count'))
        assert sum(sizes) == pytest.approx(1.0, abs=1e-3)


def test_every_layout_is_checked_here_and_installed():
    assert {path.name for path in LAYOUTS.iterdir()} == set(PATHS)
    installed = (ROOT / 'setup.py').read_text()
    assert all(f"shared('config/layouts', '*{Path(name).suffix}')" in installed for name in PATHS)

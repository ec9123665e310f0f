"""Whatever a text holds, it gives plain values or one line that says what is wrong."""

import json

import pytest

from seal_friction_ros.core.foundation.documents import DEEPEST, parse_json


def nested(levels: int, begin: str, end: str) -> str:
    return begin * levels + end * levels


@pytest.mark.parametrize('document', [None, True, 1, 1.5, 'x', [], {}, [1, [2, {'a': [3]}]], {'a': {'b': [{}]}}])
def test_a_document_is_as_it_was_written(document):
    assert parse_json(json.dumps(document), 'it') == document
    assert parse_json(json.dumps(document).encode(), 'it') == document


@pytest.mark.parametrize(('begin', 'end'), [('[', ']'), ('{"a":', '1}'), ('[{"a":', '1}]'), ('[[],', '1]')])
@pytest.mark.parametrize('levels', [100, 990, 5000, 100_000])
def test_no_depth_ends_python(levels: int, begin: str, end: str):
    for text in (begin * levels + end * levels, begin * levels):
        with pytest.raises(ValueError, match=r'^it: ') as error:
            parse_json(text, 'it')
        assert '\n' not in str(error.value)


def test_the_deepest_document_is_taken_and_one_level_more_is_not():
    assert parse_json(nested(DEEPEST, '[', ']'), 'it')
    assert parse_json('{"a":' * DEEPEST + '1' + '}' * DEEPEST, 'it')
    for text in (nested(DEEPEST + 1, '[', ']'), '{"a":' * (DEEPEST + 1) + '1' + '}' * (DEEPEST + 1)):
        with pytest.raises(ValueError, match=f'^it: more than {DEEPEST} levels deep$'):
            parse_json(text, 'it')


@pytest.mark.parametrize('text', ['', '{', '[1', 'nope', '{"a" 1}', b'\xff\xfe\xfd', '9' * 10_000])
def test_what_is_no_json_is_one_line(text):
    with pytest.raises(ValueError, match=r'^it: not JSON: ') as error:
        parse_json(text, 'it')
    assert '\n' not in str(error.value)

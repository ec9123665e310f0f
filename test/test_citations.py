"""What is quoted from the thesis and from the spool-valve paper stands in them, word by word."""

import re

from paths import ROOT

SOURCES = sorted((ROOT.parent / 'shared' / 'seeds').glob('*.txt'))  # the thesis, and the spool-valve paper
FOLDERS = {'docs': '*.md', 'seal_friction_ros': '*.py', 'seal_friction_studies': '*.py', 'config': '*.yaml'}
CITING = [path for folder, pattern in FOLDERS.items() for path in sorted((ROOT / folder).rglob(pattern))]
QUOTE = re.compile(r'["“]([^"“”]{6,300})["”]')
NAMED = re.compile(r'\b(paper|thesis)\b', re.IGNORECASE)


def plain(text: str) -> str:
    """Text on one line, without the marks of LaTeX around words."""
    return ' '.join(re.sub(r'\\text\{([^}]*)\}|[$\\]', r'\1', text).split())


def quotes(text: str) -> list[str]:
    """Phrases in double quotes in a sentence that names the paper or the thesis."""
    sentences = re.split(r'(?<=[.;!?])\s+|\n\s*\n|"""', re.sub(r'\s*\n(\s*#)?[ \t]*(?=\S)', ' ', text))
    return [plain(found) for one in sentences if NAMED.search(one) for found in QUOTE.findall(one)]


def test_a_phrase_is_a_citation_if_its_sentence_names_where_it_is_from():
    assert quotes('As the paper says, "a b\nc d". The "e f g" is ours.') == ['a b c d']
    assert quotes('Source: thesis, chapter 7 ("Defined at multiple F_n values").') == ['Defined at multiple F_n values']


def test_every_phrase_quoted_from_thesis_or_paper_stands_in_it():
    said = ' '.join(plain(source.read_text()) for source in SOURCES)
    found = [(path.relative_to(ROOT).as_posix(), one) for path in CITING for one in quotes(path.read_text())]
    assert len(SOURCES) == 2
    assert len(found) >= 6
    assert [(path, one) for path, one in found if one not in said] == []

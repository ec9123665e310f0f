"""What ``seal_friction ehl`` does: numbers for JSON, words for a person, and a page where one is asked for."""

from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.identification.spool_evaluation import SpoolEvaluation
from seal_friction_ros.core.lubrication.case import Spool
from seal_friction_ros.offline.contact.lubrication_runs import (
    compare_with_bag,
    load_case,
    run_case,
    run_map,
    run_spool,
    run_study,
    seal_document,
    single_case,
)
from seal_friction_ros.offline.reports.lubrication_report import (
    write_comparison_page,
    write_map_page,
    write_run_page,
    write_spool_page,
    write_study_page,
)
from seal_friction_ros.offline.work.seal_writer import check_new, write_seal

Answer = tuple[dict[str, Any], str]


def run_command(
    name: str, jobs: int, out: Path | None, bag: Path | None, window: list[float] | None, average: int | None
) -> Answer:
    """Run a case or a spool, or a case on the motion of a bag."""
    for option, value in (('--window', window), ('--average', average)):
        if bag is None and value is not None:
            raise ValueError(f'{option} is only for a --bag')
    case = load_case(name)
    if isinstance(case, Spool):
        if bag is not None:
            raise ValueError(f'{name}: a spool cannot be compared with a bag: take the case of one of its seals')
        spool = run_spool(case, name, jobs)
        labels = [f'{member.case}{", mirrored" if member.mirrored else ""}' for member in case.members]
        largest = float(np.abs(spool.friction[spool.last_cycle]).max())
        figures = {'spool': case.name, 'seals': labels, 'largest_friction_N': largest}
        words = f'{case.name}: {len(labels)} seals, largest friction {largest:.3g} N'
        return _paged(figures, words, out, lambda page: write_spool_page(case.name, spool, labels, page))
    if bag is not None:
        part = None if window is None else (window[0], window[1])
        law = SpoolEvaluation() if average is None else SpoolEvaluation(moving_average=average)
        comparison = compare_with_bag(case, bag, part, law)
        figures = comparison.figures()
        words = (
            f'{case.name} on {bag}: measured {figures["measured_mean_N"]:.3g} N, '
            f'computed {figures["computed_mean_N"]:.3g} N in the mean, correlation {figures["correlation"]:.2f}'
        )
        return _paged(figures, words, out, lambda page: write_comparison_page(comparison, page))
    run = run_case(case)
    words = (
        f'{case.name}: friction {run.found.friction:.3g} N, solid share {100.0 * run.found.solid_share:.1f} %; '
        f'{len(run.result.time)} steps, {run.result.retried_steps} retried'
    )
    return _paged(run.figures(), words, out, lambda page: write_run_page(run, page))


def study_command(name: str, jobs: int, out: Path | None, work: Path | None) -> Answer:
    """Study the solid shear stress of a case."""
    case = single_case(name, 'study')
    study = run_study(case, jobs, work)
    found = study.table
    figures = {
        'case': case.name,
        'solid_shear_stress_Pa': found.solid_shear_stress,
        'friction_N': found.friction,
        'solid_share': found.solid_share,
        'deviation': found.deviation,
        'curve_deviation': found.curve_deviation,
        'retried_steps': [run.retried_steps for run in study.runs],
    }
    rows = zip(*found, strict=True)
    words = '\n'.join(
        f'{stress / 1e6:5.2f} MPa: {friction:.4g} N, solid share {100.0 * share:.1f} %, '
        f'friction over stress {100.0 * deviation:+.1f} % off the mean'
        for stress, friction, share, deviation, _ in rows
    )
    return _paged(figures, words, out, lambda page: write_study_page(case, study, page))


def map_command(name: str, jobs: int, out: Path | None, work: Path | None, seal_file: Path | None) -> Answer:
    """Compute the friction map of a case."""
    case = single_case(name, 'friction map')
    if seal_file is not None:
        check_new(seal_file)
    computed = run_map(case, jobs, work)
    law = computed.law
    figures = {
        'case': case.name,
        'speed_m_s': law.speeds,
        'pressure_Pa': law.pressures,
        'friction_N': [row.friction.tolist() for row in computed.rows],
        'solid_share': [(row.solid / row.friction).tolist() for row in computed.rows],
        'memory_length_m': law.memory_length,
        'presliding_length_m': law.presliding_length,
        'retried_steps': computed.retried_steps,
    }
    low, high = min(law.frictions), max(law.frictions)
    words = f'{case.name}: {len(law.speeds)} speeds x {len(law.pressures)} pressures, {low:.3g} to {high:.3g} N'
    answer = _paged(figures, words, out, lambda page: write_map_page(computed, page))
    if seal_file is not None:
        write_seal(seal_document(computed, seal_file.stem), seal_file)
    return answer


def _paged(figures: dict[str, Any], words: str, out: Path | None, write: Any) -> Answer:
    """The answer, with the page if one is asked for."""
    if out is None:
        return figures, words
    files = write(out)
    return {**figures, 'page': out, 'figures': files}, f'{words}\n{out}: written'

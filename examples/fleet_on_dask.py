"""Many bags on a Dask cluster: replay and reduce each where it lies, and gather a table (extra `cluster`)."""

from pathlib import Path

import numpy as np
from distributed import Client

from seal_friction_ros import FrictionState, read_bag, replay

ROOT = Path(__file__).parents[1]


def summary(bag: str) -> dict[str, object]:
    """One row of the table, computed on a worker."""
    run = read_bag(bag)
    sliding = run['state'] == FrictionState.SLIDING
    return {
        'bag': Path(bag).name,
        'replays': replay(bag).identical,
        'friction_N': round(float(np.abs(run['friction_force'][sliding]).mean()), 1),
        'good': round(float((run['status'] == 0).mean()), 3),
    }


if __name__ == '__main__':
    bags = sorted(str(path.parent) for path in (ROOT / 'bags').glob('*/metadata.yaml'))
    with Client(n_workers=2, threads_per_worker=1, dashboard_address=None) as client:  # or Client('tcp://HOST:8786')
        table = client.gather(client.map(summary, bags))
    for row in table:
        print(row)
    assert [row['replays'] for row in table] == [True, True]
    assert table[1]['bag'] == 'pull_test'
    assert table[1]['good'] > 0.99
# The same with a page, trends and verdicts: seal_friction fleet bags --out fleet.html --scheduler tcp://HOST:8786

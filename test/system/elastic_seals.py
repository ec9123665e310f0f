"""A servo with elastic seals: its tracking by the feed-forward, and the friction that the estimator says.

``python test/system/elastic_seals.py``. The elasticity of the model is fitted to a simulated log of each plant: a slow
sine without feed-forward, its position from an encoder, its force with noise. Then a sine of 1 mm and 5 Hz is tracked.
The elastic feed-forward has stiffness and yield exponent of the fit, or a stiffness that is 30 % wrong; it never acts
against the wanted motion, or is allowed to (`presliding_against_motion`). Gain and lead are those of theory, not tuned.

With ``--estimate`` the friction of the estimate is compared with that of the plant instead, over sines without
feed-forward, the velocity from an encoder with noise: with rigid seals in the estimator, and with those of the fit.
With ``--random N`` the same over N random motions: strokes and rests, loads of 2 to 200 kg that swing on seals and
oil, a stiffness that is up to 15 % wrong, a moving mass that is known or not.

Exit code 1 if the elastic feed-forward is worse than none, or if less than 95 % of the samples with status 0 are in
the 95 % band with the seals of the fit.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell
from paths import ROOT

from seal_friction_ros.core.estimation import estimator
from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.pipeline import PipelineParameters
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.identification.presliding_fit import PreslidingFit, ReversalLog, fit_presliding
from seal_friction_ros.core.messages.records import Force, Pressure, Status
from seal_friction_ros.core.servo.closed_loop import Axis, run_closed_loop
from seal_friction_ros.core.servo.elastic_plant import ElasticSeals
from seal_friction_ros.core.servo.motions import Setpoint, Sine
from seal_friction_ros.core.servo.plant import Load
from seal_friction_ros.core.servo.position_servo import ServoParameters, init, simulate
from seal_friction_ros.core.servo.tracking import tracking_rms
from seal_friction_ros.files import read_yaml

LIGHT = 5.0  # [kg] load of the simulated servo
ENCODER_STEP = 1e-6  # [m]
ENCODER_NOISE = 0.3  # [-] of a step, for the estimate
FORCE_NOISE = 1.0  # [N]
RANDOM_DURATION = 12.0  # [s] of a random motion
DELAY = 1e-3  # [s] from a velocity sample to the feed-forward in the controller
SEAL = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))
SEALS = tuple(MountedSeal(SEAL, chamber) for chamber in 'ab')

PLANTS = {
    'elements, 1e5 N/m': ElasticSeals(Presliding(stiffness=1e5)),
    'elements, 1e5 N/m, equal yields': ElasticSeals(Presliding(stiffness=1e5, yield_exponent=0.0)),
    'elements, 4e5 N/m': ElasticSeals(Presliding(stiffness=4e5)),
    'elements, 1e6 N/m': ElasticSeals(Presliding(stiffness=1e6)),
    'LuGre, 3e5 N/m': ElasticSeals(Presliding(stiffness=3e5), bristle_damping=100.0),
    'unlike seals, 3.5e5 N/m': ElasticSeals(
        Presliding(stiffness=1e5, yield_exponent=2.0), Presliding(stiffness=2.5e5, yield_exponent=0.3), 0.6
    ),
}

MOTIONS = {
    '1 mm at 5 Hz': (Sine(1e-3, 5.0), 3.0),
    '5 mm at 0.5 Hz': (Sine(5e-3, 0.5), 8.0),
    '2 mm at 0.1 Hz': (Sine(2e-3, 0.1), 20.0),
}
"""Motion and its duration [s], for the estimate."""
Row = dict[str, Any]


class RandomStrokes(NamedTuple):
    """Smooth strokes of 0.05 to 6 mm in 0.06 to 1.6 s, with rests of up to 1.5 s between them."""

    time: FloatArray  # [s]
    position: FloatArray  # [m]
    velocity: FloatArray  # [m/s]

    def at(self, time: float) -> Setpoint:
        """Setpoint at ``time`` [s]."""
        position, velocity = (float(np.interp(time, self.time, values)) for values in self[1:])
        return Setpoint(position, velocity, 0.0)


def random_strokes(rng: np.random.Generator, duration: float) -> RandomStrokes:
    """Random strokes for ``duration`` [s], within 8 mm of the middle."""
    positions, place = [0.0], 0.0
    while len(positions) < 1e3 * duration:
        positions += [place] * int(rng.choice([0, 20, 120, 400, 1500]))  # [ms]
        way = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-4.3, -2.2))
        way = -way if abs(place + way) > 8e-3 else way
        share = np.linspace(0.0, 1.0, int(1e3 * 10.0 ** rng.uniform(-1.2, 0.2)))
        positions += (place + way * (3.0 * share**2 - 2.0 * share**3)).tolist()
        place += way
    position = np.array(positions)
    return RandomStrokes(1e-3 * np.arange(len(position)), position, np.gradient(position, 1e-3))


class Result(NamedTuple):
    """Tracking RMS [m] on one plant."""

    without: float
    rigid: float
    elastic: float
    softer: float  # stiffness of the model 30 % too low
    stiffer: float  # 30 % too high
    against: float  # with `presliding_against_motion`, as the next two
    against_softer: float
    against_stiffer: float


def identified(elastic: ElasticSeals) -> PreslidingFit:
    """Elasticity fitted to a simulated log of a servo without feed-forward."""
    servo = ServoParameters(seals=SEALS, elastic=elastic)
    wave = Sine(amplitude=5e-3, frequency=0.25)
    samples = round(6.0 / wave.frequency / servo.control_period)
    _, rows = simulate(servo, init(servo), [wave.at(i * servo.control_period) for i in range(samples)])
    rng = np.random.default_rng(19)
    position = ENCODER_STEP * np.round(rows.position / ENCODER_STEP)[::4]
    force = (rows.force_sum + FORCE_NOISE * rng.normal(size=samples))[::4]  # slow: no inertia
    time = servo.control_period * np.arange(samples)[::4]
    return fit_presliding([ReversalLog('simulated log', time, position, force)])


def tracking(elastic: ElasticSeals, model: Presliding | None, settings: FeedForwardSettings) -> float:
    """Tracking RMS [m] over four periods, after two."""
    servo = ServoParameters(seals=SEALS, elastic=elastic)
    half = replace(model, stiffness=0.5 * model.stiffness) if model else None
    seals = tuple(MountedSeal(replace(SEAL, presliding=half), chamber) for chamber in 'ab')
    parameters = PipelineParameters(EstimatorParameters(EstimatorSettings(), seals), settings)
    wave, period = Sine(amplitude=1e-3, frequency=5.0), servo.control_period
    run = run_closed_loop(Axis(servo, parameters), wave, round(6.0 / wave.frequency / period), DELAY)
    first = round(2.0 / wave.frequency / period)
    return tracking_rms(run.reference[first:], run.position[first:])


def result(elastic: ElasticSeals, model: Presliding) -> Result:
    """Tracking on a plant with the elasticity ``model`` of the feed-forward."""
    gains = ServoParameters(seals=()).gains
    lead = DELAY + 1.0 / gains.controller.force_bandwidth + gains.valve_delay
    rigid = FeedForwardSettings(scale=1.0, lead_time=lead, slew_limit=1e9, force_limit=100.0)
    on = replace(rigid, presliding=True)
    models = [replace(model, stiffness=factor * model.stiffness) for factor in (1.0, 0.7, 1.3)]
    chosen = (on, replace(on, presliding_against_motion=True))
    found = [tracking(elastic, made, settings) for settings in chosen for made in models]
    return Result(tracking(elastic, None, replace(rigid, scale=0.0)), tracking(elastic, None, rigid), *found)


class EstimateErrors(NamedTuple):
    """Friction force of the estimate less that of the plant."""

    rms: float  # [-] of all samples whose state is known, over the Coulomb friction
    good: float  # [-] share of samples with status 0
    rms_good: float  # [-] of these; NaN: none
    in_band: float  # [-] share of these in their 95 % band; NaN: none
    rms_shearing: float  # [-] of the samples with PRESLIDING; NaN: none
    shearing_in_band: float  # [-] share of these; NaN: none


def estimate_errors(
    elastic: ElasticSeals,
    model: Presliding | None,
    wave: Sine | RandomStrokes,
    duration: float,
    mass: float = LIGHT,
    known_mass: float = 0.0,
) -> EstimateErrors:
    """Errors over ``duration`` [s] of a motion, the first quarter left out; ``model`` None: rigid seals."""
    servo = ServoParameters(seals=SEALS, elastic=elastic, load=Load(mass=mass))
    samples, period = round(duration / servo.control_period), round(1e9 * servo.control_period)
    _, rows = simulate(servo, init(servo), [wave.at(i * servo.control_period) for i in range(samples)])
    rng = np.random.default_rng(20)
    counts = np.round(rows.position / ENCODER_STEP + ENCODER_NOISE * rng.normal(size=samples))
    velocity = ENCODER_STEP / servo.control_period * np.diff(counts, prepend=counts[0])
    force_sum = rows.force_sum + FORCE_NOISE * rng.normal(size=samples)
    half = replace(model, stiffness=0.5 * model.stiffness) if model else None
    seals = tuple(MountedSeal(replace(SEAL, presliding=half), chamber) for chamber in 'ab')
    parameters = EstimatorParameters(EstimatorSettings(), seals, AdaptationSettings(moving_mass=known_mass))
    state, found = estimator.init(parameters), []
    for i, (v, a, b, force) in enumerate(
        zip(velocity.tolist(), rows.pressure_a.tolist(), rows.pressure_b.tolist(), force_sum.tolist(), strict=True)
    ):
        stamp = 10**9 + i * period
        sample = RodSample(stamp, v, Pressure(stamp, a, b), Force(stamp, force))
        state, estimate = estimator.step(parameters, state, sample)
        found.append((estimate.friction_force, estimate.coulomb_friction_std, estimate.status, estimate.state))
    friction, std, status, states = np.array(found)[samples // 4 :].T
    error = friction - rows.friction_force[samples // 4 :]
    known, good = states != FrictionState.UNKNOWN, status == 0
    shearing = status.astype(int) & int(Status.PRESLIDING) != 0
    size = float(rows.coulomb_friction.mean())
    in_band = np.abs(error) <= BAND_95 * std
    return EstimateErrors(
        _rms(error[known]) / size,
        float(good.mean()),
        _rms(error[good]) / size,
        float(in_band[good].mean()) if good.any() else math.nan,
        _rms(error[shearing]) / size,
        float(in_band[shearing].mean()) if shearing.any() else math.nan,
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values * values))) if len(values) else math.nan


def estimates(name: str, motions: Sequence[str], mass: float) -> list[Row]:
    """A row for each motion of a plant, with rigid seals in the estimator and with those of the fit."""
    models, rows = {'rigid': None, 'elastic': identified(PLANTS[name]).presliding}, []
    for motion in motions:
        found = {words: estimate_errors(PLANTS[name], model, *MOTIONS[motion], mass) for words, model in models.items()}
        plant = name if len(motions) == 1 else f'{name}; {motion}'
        rows.append({'plant': plant, **{words: _percent(errors) for words, errors in found.items()}})
    return rows


def on_random_motions(count: int) -> list[Row]:
    """A row for each motion."""
    models, rows = {name: identified(elastic).presliding for name, elastic in PLANTS.items()}, list[Row]()
    for seed in range(count):
        rng, name = np.random.default_rng([21, seed]), list(PLANTS)[seed % len(PLANTS)]
        mass = float(rng.choice([2.0, 5.0, 50.0, 200.0]))
        known = mass * float(rng.integers(2))
        model = replace(models[name], stiffness=rng.uniform(0.85, 1.15) * models[name].stiffness)
        wave = random_strokes(rng, RANDOM_DURATION)
        found = estimate_errors(PLANTS[name], model, wave, RANDOM_DURATION, mass, known)
        rows.append({'plant': f'{seed}: {name}, {mass:g} kg, {known:g} kg known', 'elastic': _percent(found)})
    return rows


def least_in_band(rows: Sequence[Row]) -> float:
    """Least share of good samples in their band with elastic seals [%]."""
    return min((row['elastic']['in band'] for row in rows if row['elastic']['in band'] is not None), default=100.0)


def _percent(errors: EstimateErrors) -> dict[str, float | None]:
    names = ('error', 'status 0', 'error of these', 'in band', 'error with PRESLIDING', 'these in band')
    return {name: None if math.isnan(x) else round(100.0 * x, 1) for name, x in zip(names, errors, strict=True)}


def reductions(name: str) -> Row:
    """Reduction of the tracking error by each feed-forward [%]; in brackets with 0.7 and 1.3 times the stiffness."""
    found = result(PLANTS[name], identified(PLANTS[name]).presliding)
    rigid, right, soft, stiff, *against = (round(100.0 * (1.0 - rms / found.without)) for rms in found[1:])
    return {
        'plant': name,
        'rigid model': rigid,
        'elastic model': f'{right} ({soft}, {stiff})',
        'against the motion': f'{against[0]} ({against[1]}, {against[2]})',
        'worst': min(right, soft, stiff, *against),
    }


def main() -> int:
    """Measure every plant; print a table."""
    numbers = {
        'mass': (LIGHT, 'load [kg], for the estimate'),
        'random': (0, 'the estimate over N random motions instead'),
    }
    parser = parser_of(__doc__, **numbers)
    parser.add_argument('--plants', nargs='*', choices=sorted(PLANTS), default=list(PLANTS))
    parser.add_argument('--estimate', action='store_true', help='the friction of the estimate instead')
    parser.add_argument('--motions', nargs='*', choices=sorted(MOTIONS), default=list(MOTIONS), help='of the estimate')
    options = parser.parse_args()
    if options.random or options.estimate:
        each = (estimates(name, options.motions, options.mass) for name in options.plants)
        rows = on_random_motions(options.random) if options.random else [row for found in each for row in found]
        holds = least_in_band(rows) >= 95.0
    else:
        rows = [reductions(name) for name in options.plants]
        holds = min(row['worst'] for row in rows) >= 0
    tell(rows, as_json=options.json)
    return 0 if holds else 1


if __name__ == '__main__':
    sys.exit(main())

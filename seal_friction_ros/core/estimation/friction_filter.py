r"""One Bayesian filter: what the friction is on this machine today, and how well that is known.

While the rod slides, the force sum less inertia is a reading of the friction and of what is not friction:

.. math:: y = \Sigma F - m a = d\,(s f + c + u) + k v + a f + b + n + e

with f the friction of the law of the seal files at the pressure and speed in use, d = +-1 the direction, v the
velocity, and the state of the filter:

====  =============================================================================================
s     scale of the law
c     share of Coulomb friction that does not follow the law [N]
k     viscous friction that the law does not have [N s/m]
a     asymmetry: part of the friction that has another size in the two directions
b     offset of the force sum where the rod is now: load, area or sensor zero that nobody took off [N]
g     gradient of the offset over the way: load over position, as of a boom or a gas spring [N/m]
n     remainder: what none of these explains and what passes within `REMAINDER_TIME` [N]
u     misfit: friction that the law misses at the present pressure, beside c [N]
====  =============================================================================================

The offset goes on with the way x of the rod, :math:`b_{i+1} = b_i + g\,\Delta x`; n and u are first-order Gauss-Markov
processes, n over time and u over the relative change of f; the others are random walks and e is white. Friction is all
but b, g and n, and its variance is that of the posterior: what cannot be told apart, as asymmetry from offset in one
pressure, stays in the band, and so does a gradient beyond the longest stroke that the rod came back from. Terms that a
motion does not excite keep their prior.

The misfit keeps the scale the mean over all pressures: no law is right at each, and a law of one kind of seals for two
misses some by a tenth. Without u the scale would be that of the pressure seen last.

The remainder makes the filter what it is: a friction that wavers over a stroke would else drag offset and scale along
from one side of their band to the other. Samples that are too far away count less, as with noise of heavy tails; if
they begin suddenly and go on, they are a step of the load. The noise of e follows the innovations.

Source: [Kalman1960]_; random walks, noise from the innovations and consistency as in [BarShalom2001]_ chapters 5 and
11; coloured noise as one more state as in [Jazwinski1970]_; weights of outliers after [Agamennoni2012]_. Model, prior
and the numbers are our choice.
"""

import math
from typing import NamedTuple

from seal_friction_ros.core.foundation.compiled import compilable, replace
from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.messages.records import NEVER

# Prior: one standard deviation. A share is one of the friction by the law at the first sample.
SCALE_PRIOR = 0.3  # [-] of another day, beside the deviation of the seal file
COULOMB_PRIOR = 0.3  # [-] share
VISCOUS_PRIOR = 2.0  # [s/m] share per speed
ASYMMETRY_PRIOR = 0.1  # [-] so that 15 % of a friction 1.25 times that of the file are in the band
OFFSET_PRIOR = 10.0  # [-] share
GRADIENT_PRIOR = 30.0  # [1/m] share over the way
# Random walks: one standard deviation after one second.
WALK = 0.012  # [-] of scale, Coulomb share, viscous friction and asymmetry, each a share of its prior
OFFSET_WALK = 0.002  # [-] share
# The gradient walks with the way: share over the longest stroke, after such a stroke.
GRADIENT_WALK = 1.0  # [-]
CURVED = 0.2  # [-] share: root mean square of an unexplained drift from which on the load may be curved over the way
SHORTEST_STROKE = 1e-4  # [m]
MISFIT = 0.06  # [-] share: standard deviation of u
MISFIT_RANGE = 0.5  # [-] relative change of the friction of the law over which u passes
REMAINDER_TIME = 0.4  # [s] time constant of n
REMAINDER = 0.05  # [-] share: standard deviation of n
LEAST_NOISE = 0.1  # [-] share: standard deviation of e at first and at least, since readings in a row miss alike
USUAL_TIME = 60.0  # [s] over which the friction of the law is the usual one: a law misses low friction by no less
NOISE_TIME = 5.0  # [s] in which the noise follows the innovations
OUTLIER = 2.5  # [-] innovations over their standard deviation count less beyond this
LEAP = 3.0  # [-] innovations over their deviation within two readings, or at the turn, that may begin a step
STEP_READINGS = 10  # outliers in a row to one side that make it one,
FEWEST_OUTLIERS = 3  # or these before the rod turns
STEP_OF_FRICTION = 0.6  # [-] of a step: standard deviation of what may be friction (all of it), until a stroke tells
LEAST_STRAYED = 0.75  # [-] of what the offset took in a stroke: what the next misses at least, if it was friction,
MOST_STRAYED = 2.25  # [-] and at most: once if it is gone again, else twice
LOADED = 2.0  # [-] squared innovation over the squared change at rest up to which that is its cause: means take a part
PROVEN = 0.25  # [-] share: standard deviation of the friction below which the motion has told it
WRONG_DIRECTION = 1.5  # [-] of the friction that a sample misses whose direction is wrong: it misses twice the friction
DRIFT_TIME = 0.08  # [s] over which white noise averages out of what is not explained
DRIFT_MEMORY = 10.0  # [s] over which the size of the rest is known
LONGEST_STEP = 0.1  # [s] of motion that one sample stands for


class Terms(NamedTuple):
    """The state of the filter, or a row of its covariance."""

    scale: float  # s
    coulomb: float  # c
    viscous: float  # k
    asymmetry: float  # a
    offset: float  # b
    gradient: float  # g
    remainder: float  # n
    misfit: float  # u


class Covariance(NamedTuple):
    """Of the state, which is symmetric: its upper triangle, row by row. Two letters name two terms."""

    ss: float
    sc: float
    sk: float
    sa: float
    sb: float
    sg: float
    sn: float
    su: float
    cc: float
    ck: float
    ca: float
    cb: float
    cg: float
    cn: float
    cu: float
    kk: float
    ka: float
    kb: float
    kg: float
    kn: float
    ku: float
    aa: float
    ab: float
    ag: float
    an: float
    au: float
    bb: float
    bg: float
    bn: float
    bu: float
    gg: float
    gn: float
    gu: float
    nn: float
    nu: float
    uu: float


class Unexplained(NamedTuple):
    """What neither friction nor offset explains: n + e."""

    noise: float = 0.0  # [-] standard deviation of e over the usual friction of the law, or the present if larger
    usual: float = 0.0  # [N] friction of the law, mean over `USUAL_TIME`
    drift: float = 0.0  # [N] mean over `DRIFT_TIME`
    drift_square: float = 0.0  # [N^2] mean square of the drift over `DRIFT_MEMORY`
    square: float = 0.0  # [N^2] mean square over `DRIFT_MEMORY`


class Outliers(NamedTuple):
    """Readings in a row that were too far away after a sudden beginning."""

    number: int  # with the sign of their innovations
    last: float  # [N] last innovation
    second: float  # [N] the one before, in the same direction
    settled: Terms  # before the first of them


class FrictionFilter(NamedTuple):
    """What one reading leaves for the next."""

    stamp: int  # [ns] of the last reading; `NEVER` before the first
    direction: int  # -1 or 1 then; 0: none
    speed: float  # [m/s] then
    stroke: float  # [m] way in this direction so far
    longest: float  # [m] way in one direction before
    gradient: float  # [N/m] g at the end of the direction before
    strayed: float  # [N] what readings in this direction have added to the offset: it may be friction until the next
    stepped: float  # [N^2] square of what steps in this direction may have been of the friction
    load_step: float  # [N] largest step, which fades over `USUAL_TIME` of motion: the next may come at rest, unseen
    friction: float  # [N] by the law then
    friction_std: float  # [N] of the friction then
    innovation_std: float  # [N] of its innovation
    terms: Terms
    covariance: Covariance
    unexplained: Unexplained
    outliers: Outliers


NO_TERMS = Terms(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NO_COVARIANCE = Covariance(*[0.0] * 36)
NOT_BEGUN = FrictionFilter(
    stamp=NEVER,
    direction=0,
    speed=0.0,
    stroke=0.0,
    longest=SHORTEST_STROKE,
    gradient=0.0,
    strayed=0.0,
    stepped=0.0,
    load_step=0.0,
    friction=0.0,
    friction_std=0.0,
    innovation_std=0.0,
    terms=Terms(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    covariance=NO_COVARIANCE,
    unexplained=Unexplained(),
    outliers=Outliers(0, 0.0, 0.0, NO_TERMS),
)
"""State before the first reading."""


class Reading(NamedTuple):
    """One reading of the friction."""

    stamp: int  # [ns]
    force: float  # [N] y
    direction: int  # d
    velocity: float  # [m/s] v
    way: float  # [m] from the reading before
    friction: float  # [N] f of the law, > 0
    friction_std: float  # [N] of a new reading, by the seal file
    loaded: float = 0.0  # [N] sudden change of the force sum in the rest before: it may be a load


@compilable
def friction_magnitude(terms: Terms, direction: float, speed: float, friction: float) -> float:
    """Friction of a rod that slides [N], never negative; at a ``direction`` of 0 the mean of both."""
    magnitude = terms.scale * friction + terms.coulomb + terms.misfit + terms.viscous * speed
    magnitude += direction * terms.asymmetry * friction
    return magnitude if magnitude > 0.0 else 0.0


@compilable
def expected(terms: Terms, reading: Reading) -> float:
    """Force sum that these terms let a reading expect [N]."""
    t, law = terms, reading.friction
    friction = reading.direction * (t.scale * law + t.coulomb + t.misfit)
    return friction + t.viscous * reading.velocity + t.asymmetry * law + t.offset + t.remainder


@compilable
def _gains(covariance: Covariance, reading: Reading) -> Terms:
    """Covariance of each term with what a reading has to show [N times the unit of the term]."""
    c, k, a = float(reading.direction), reading.velocity, reading.friction
    s = c * a
    p = covariance
    return Terms(
        s * p.ss + c * p.sc + k * p.sk + a * p.sa + p.sb + p.sn + c * p.su,
        s * p.sc + c * p.cc + k * p.ck + a * p.ca + p.cb + p.cn + c * p.cu,
        s * p.sk + c * p.ck + k * p.kk + a * p.ka + p.kb + p.kn + c * p.ku,
        s * p.sa + c * p.ca + k * p.ka + a * p.aa + p.ab + p.an + c * p.au,
        s * p.sb + c * p.cb + k * p.kb + a * p.ab + p.bb + p.bn + c * p.bu,
        s * p.sg + c * p.cg + k * p.kg + a * p.ag + p.bg + p.gn + c * p.gu,
        s * p.sn + c * p.cn + k * p.kn + a * p.an + p.bn + p.nn + c * p.nu,
        s * p.su + c * p.cu + k * p.ku + a * p.au + p.bu + p.nu + c * p.uu,
    )


@compilable
def begun(reading: Reading) -> FrictionFilter:
    """Filter with its prior, at the first reading."""
    force = reading.friction
    by_file = reading.friction_std / force
    scale = math.sqrt(SCALE_PRIOR * SCALE_PRIOR + by_file * by_file)  # hypot differs by a bit in compiled code
    coulomb, viscous, offset = COULOMB_PRIOR * force, VISCOUS_PRIOR * force, OFFSET_PRIOR * force
    gradient, remainder, misfit = GRADIENT_PRIOR * force, REMAINDER * force, MISFIT * force
    diagonal = replace(
        NO_COVARIANCE, ss=scale * scale, cc=coulomb * coulomb, kk=viscous * viscous,
        aa=ASYMMETRY_PRIOR * ASYMMETRY_PRIOR, bb=offset * offset, gg=gradient * gradient, nn=remainder * remainder,
        uu=misfit * misfit,
    )  # fmt: skip
    return replace(
        NOT_BEGUN,
        stamp=reading.stamp,
        friction=force,
        covariance=diagonal,
        unexplained=Unexplained(LEAST_NOISE, force, 0.0, 0.0, 0.0),
    )


@compilable
def _predicted_terms(t: Terms, way: float, kept: float, fits: float) -> Terms:
    """State after a way [m]: the offset takes its gradient along, shares of n and u are left."""
    return Terms(
        t.scale, t.coulomb, t.viscous, t.asymmetry, t.offset + way * t.gradient, t.gradient, kept * t.remainder,
        fits * t.misfit,
    )  # fmt: skip


@compilable
def _predicted(
    known: FrictionFilter, reading: Reading, fits: float, elapsed: float, moved: float, longest: float
) -> Covariance:
    """Covariance before the next reading: the offset takes its gradient along, n and u fade, the others walk.

    Args:
        known: Before the reading.
        reading: With the way to it.
        fits: Share of u that is left at its pressure.
        elapsed: [s] since the reading before: offset and n change at rest, too.
        moved: [s] of it in motion.
        longest: Stroke [m].
    """
    way, law, drift = reading.way, reading.friction, CURVED * reading.friction
    kept = REMAINDER_TIME / (REMAINDER_TIME + elapsed)
    coulomb, viscous, offset = COULOMB_PRIOR * law, VISCOUS_PRIOR * law, OFFSET_WALK * law
    walk, gradient, remainder = moved * WALK * WALK, GRADIENT_WALK * law / longest, REMAINDER * law
    curved = abs(way) / longest if known.unexplained.drift_square > drift * drift else 0.0
    misfit = MISFIT * law
    p = known.covariance
    return Covariance(
        p.ss + walk * SCALE_PRIOR * SCALE_PRIOR, p.sc, p.sk, p.sa, p.sb + way * p.sg, p.sg, kept * p.sn, fits * p.su,
        p.cc + walk * coulomb * coulomb, p.ck, p.ca, p.cb + way * p.cg, p.cg, kept * p.cn, fits * p.cu,
        p.kk + walk * viscous * viscous, p.ka, p.kb + way * p.kg, p.kg, kept * p.kn, fits * p.ku,
        p.aa + walk * ASYMMETRY_PRIOR * ASYMMETRY_PRIOR, p.ab + way * p.ag, p.ag, kept * p.an, fits * p.au,
        p.bb + way * (2.0 * p.bg + way * p.gg) + elapsed * offset * offset, p.bg + way * p.gg,
        kept * (p.bn + way * p.gn), fits * (p.bu + way * p.gu),
        p.gg + curved * gradient * gradient, kept * p.gn, fits * p.gu,
        kept * kept * p.nn + (1.0 - kept * kept) * remainder * remainder, kept * fits * p.nu,
        fits * fits * p.uu + (1.0 - fits * fits) * misfit * misfit,
    )  # fmt: skip


@compilable
def _stroke_after(known: FrictionFilter, reading: Reading) -> tuple[float, float, float, float]:
    """`FrictionFilter.stroke`, ``longest``, ``gradient`` and ``strayed`` before a reading is learnt from."""
    stroke, longest, now = abs(reading.way), known.longest, known.terms.gradient
    if reading.direction == known.direction:
        strayed = known.strayed + reading.way * (now - known.gradient)
        return known.stroke + stroke, longest, known.gradient, strayed
    return stroke, known.stroke if known.stroke > longest else longest, now, 0.0


@compilable
def updated(known: FrictionFilter, reading: Reading) -> FrictionFilter:
    """Filter after one more reading: predict, look for a step, correct, and follow what is left."""
    if known.stamp == NEVER:
        known = begun(reading)
    elapsed = between(0.0, (reading.stamp - known.stamp) * 1e-9, 3600.0)
    moved = elapsed if elapsed < LONGEST_STEP else LONGEST_STEP
    kept, law = REMAINDER_TIME / (REMAINDER_TIME + elapsed), reading.friction
    fits = MISFIT_RANGE / (MISFIT_RANGE + 2.0 * abs(law - known.friction) / (law + known.friction))
    stroke, longest, gradient, strayed = _stroke_after(known, reading)
    terms = _predicted_terms(known.terms, reading.way, kept, fits)
    offset = terms.offset
    covariance = _predicted(known, reading, fits, elapsed, moved, stroke if stroke > longest else longest)
    innovation = reading.force - expected(terms, reading)
    usual = known.unexplained.usual
    noise = known.unexplained.noise * (reading.friction if reading.friction > usual else usual)
    gains = _gains(covariance, reading)
    variance = expected(gains, reading) + noise * noise
    stepped = known.stepped if reading.direction == known.direction else 0.0
    load_step = known.load_step * (1.0 - moved / USUAL_TIME)
    freed, is_explained = _explained(known, reading, covariance, innovation, variance)
    if is_explained:
        outliers, steps, left = replace(known.outliers, number=0), False, 0.0
    else:
        outliers, steps = _outliers(known, reading.direction, terms, innovation, variance)
        left = innovation
        if steps:
            terms = outliers.settled
            innovation = reading.force - expected(terms, reading)
            freed = replace(covariance, bb=covariance.bb + innovation * innovation)
            stepped += STEP_OF_FRICTION * innovation * STEP_OF_FRICTION * innovation
            load_step = abs(innovation) if abs(innovation) > load_step else load_step
    unexplained = _followed(known, reading.friction, left + terms.remainder, left * left / variance, moved)
    if is_explained or steps:
        gains = _gains(freed, reading)
    if outliers.number == 0 or abs(outliers.number) > FEWEST_OUTLIERS:  # the first ones may begin a step
        terms, covariance = _corrected(terms, freed, gains, expected(gains, reading), innovation, noise)

    untold = terms.gradient * (stroke - longest) if stroke > longest else 0.0
    std = friction_std(covariance, unexplained.drift_square + untold * untold, reading)
    if outliers.number == 0:
        outliers = Outliers(0, outliers.last, outliers.second, terms)
    return FrictionFilter(
        reading.stamp,
        reading.direction,
        abs(reading.velocity),
        stroke,
        longest,
        gradient,
        strayed + terms.offset - offset if longest > SHORTEST_STROKE else 0.0,
        stepped,
        load_step,
        reading.friction,
        std,
        math.sqrt(variance),
        terms,
        covariance,
        unexplained,
        outliers,
    )


@compilable
def doubt_of(known: FrictionFilter) -> float:
    """Variance of the friction that the readings leave [N^2]; nothing tells yet whose a step in this direction was."""
    return known.friction_std * known.friction_std + known.stepped


@compilable
def disregarded(known: FrictionFilter, reading: Reading, elapsed: float) -> FrictionFilter:
    """Filter after an outlier of a rod that may be at rest: nothing is learnt from it, but the band holds it.

    Args:
        known: Before the reading.
        reading: What it shows.
        elapsed: [s] that it stands for.
    """
    terms = replace(known.terms, offset=known.terms.offset + reading.way * known.terms.gradient)
    missed = reading.force - expected(terms, reading) + terms.remainder
    return replace(known, unexplained=_followed(known, reading.friction, missed, 1.0, elapsed))


@compilable
def _corrected(
    terms: Terms, covariance: Covariance, gains: Terms, spread: float, innovation: float, noise: float
) -> tuple[Terms, Covariance]:
    """Mean and covariance after an innovation [N]; an outlier counts less, as with noise of heavy tails.

    Args:
        terms: Before.
        covariance: Before.
        gains: Covariance times the coefficients of the reading.
        spread: Variance of what was expected [N^2].
        innovation: [N]
        noise: Standard deviation of the reading [N].
    """
    variance = spread + noise * noise
    distance = abs(innovation) / math.sqrt(variance)
    if distance > OUTLIER:
        variance = spread + noise * noise * (distance / OUTLIER) * (distance / OUTLIER)
    s, c, k, a = gains.scale, gains.coulomb, gains.viscous, gains.asymmetry
    b, g, n, u = gains.offset, gains.gradient, gains.remainder, gains.misfit
    sv, cv, kv, av = s / variance, c / variance, k / variance, a / variance
    bv, gv, nv, uv = b / variance, g / variance, n / variance, u / variance
    p = covariance
    corrected = Terms(
        terms.scale + sv * innovation, terms.coulomb + cv * innovation, terms.viscous + kv * innovation,
        terms.asymmetry + av * innovation, terms.offset + bv * innovation, terms.gradient + gv * innovation,
        terms.remainder + nv * innovation, terms.misfit + uv * innovation,
    )  # fmt: skip
    return corrected, Covariance(
        p.ss - sv * s, p.sc - sv * c, p.sk - sv * k, p.sa - sv * a,
        p.sb - sv * b, p.sg - sv * g, p.sn - sv * n, p.su - sv * u,
        p.cc - cv * c, p.ck - cv * k, p.ca - cv * a, p.cb - cv * b, p.cg - cv * g, p.cn - cv * n, p.cu - cv * u,
        p.kk - kv * k, p.ka - kv * a, p.kb - kv * b, p.kg - kv * g, p.kn - kv * n, p.ku - kv * u,
        p.aa - av * a, p.ab - av * b, p.ag - av * g, p.an - av * n, p.au - av * u,
        p.bb - bv * b, p.bg - bv * g, p.bn - bv * n, p.bu - bv * u,
        p.gg - gv * g, p.gn - gv * n, p.gu - gv * u,
        p.nn - nv * n, p.nu - nv * u,
        p.uu - uv * u,
    )  # fmt: skip


@compilable
def _explained(
    known: FrictionFilter, reading: Reading, covariance: Covariance, innovation: float, variance: float
) -> tuple[Covariance, bool]:
    """Covariance with what an outlier [N] frees if its cause is known, and whether it is.

    A sudden change of the force sum in the rest before is a load: it frees the offset. A rod that has turned and misses
    twice what the offset took in the stroke before, to the other side, shows that this was friction; so does one that
    misses as much as it took at the turn before: friction that is gone. That frees the scale, and the offset as far as
    it made up for it.
    """
    surprise, strayed = innovation * innovation, known.strayed
    if surprise <= OUTLIER * OUTLIER * variance:
        return covariance, False
    if innovation * reading.loaded > 0.0 and surprise < LOADED * reading.loaded * reading.loaded:
        return replace(covariance, bb=covariance.bb + surprise), True
    missed, square = -innovation * strayed, strayed * strayed
    if reading.direction == known.direction or not LEAST_STRAYED * square < missed < MOST_STRAYED * square:
        return covariance, False
    force = reading.direction * reading.friction
    half = 0.25 * surprise  # [N^2] scale and offset show one half of it each
    shared = half / force
    return replace(
        covariance, ss=covariance.ss + shared / force, sb=covariance.sb + shared, bb=covariance.bb + half
    ), True


@compilable
def _outliers(
    known: FrictionFilter, direction: int, terms: Terms, innovation: float, variance: float
) -> tuple[Outliers, bool]:
    """Outliers after an innovation [N], and whether they are a step."""
    number, last, second, settled = known.outliers
    turns, side = direction != known.direction, 0
    if innovation * innovation > OUTLIER * OUTLIER * variance:
        side = 1 if innovation > 0.0 else -1
    goes_on = number * side > 0
    leap = innovation if turns else innovation - second
    if not goes_on and leap * leap < LEAP * LEAP * variance:
        side = 0
    count = number + side if goes_on else side
    steps = abs(count) >= STEP_READINGS or (turns and abs(number) >= FEWEST_OUTLIERS)
    settled, second = settled if number != 0 else terms, innovation if turns else last
    return Outliers(0 if steps else count, innovation, second, settled), steps


@compilable
def _followed(known: FrictionFilter, friction: float, unexplained: float, excess: float, moved: float) -> Unexplained:
    """What is not explained after ``unexplained`` [N] more; ``excess`` is the squared innovation over its variance."""
    noise, usual, drift, drift_square, square = known.unexplained
    excess = excess if excess < OUTLIER * OUTLIER else OUTLIER * OUTLIER
    variance = noise * noise * (1.0 + moved / (moved + NOISE_TIME) * (excess - 1.0))
    if known.direction == 0:
        unexplained = 0.0  # all of it may be offset
    most = WRONG_DIRECTION * friction  # more is no error of a friction
    unexplained = between(-most, unexplained, most)
    drift += moved / (moved + DRIFT_TIME) * (unexplained - drift)
    share = moved / (moved + DRIFT_MEMORY)
    return Unexplained(
        between(LEAST_NOISE, math.sqrt(variance), 1.0),
        usual + moved / (moved + USUAL_TIME) * (friction - usual),
        drift,
        drift_square + share * (drift * drift - drift_square),
        square + share * (unexplained * unexplained - square),
    )


@compilable
def friction_std(covariance: Covariance, drift_square: float, reading: Reading) -> float:
    """Standard deviation of the friction of a rod that slides [N]: of its terms, and of a drift that may be friction.

    Args:
        covariance: Of the state.
        drift_square: Mean square of what drifts and may be friction [N^2].
        reading: That the friction is asked for.
    """
    c, k, a = float(reading.direction), reading.velocity, reading.friction
    s, p, least = c * a, covariance, REMAINDER * a * REMAINDER * a
    variance = s * s * p.ss + c * c * (p.cc + 2.0 * p.cu + p.uu) + k * k * p.kk + a * a * p.aa
    variance += 2.0 * (s * (c * (p.sc + p.su) + k * p.sk + a * p.sa) + c * (k * (p.ck + p.ku) + a * (p.ca + p.au)))
    variance += 2.0 * k * a * p.ka
    variance += drift_square if drift_square > least else least
    return math.sqrt(variance) if variance > 0.0 else 0.0

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
ASYMMETRY_PRIOR = 0.08  # [-]
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
STEP_OF_FRICTION = 0.5  # [-] standard deviation of the scale over that of the offset after a step, both as forces
PROVEN = 0.25  # [-] share: standard deviation of the friction below which the motion has told it
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
    is_stepped: bool  # whether there was a step that no reversal has explained


class FrictionFilter(NamedTuple):
    """What one reading leaves for the next."""

    stamp: int  # [ns] of the last reading; `NEVER` before the first
    direction: int  # -1 or 1 then; 0: none
    speed: float  # [m/s] then
    stroke: float  # [m] way in this direction so far
    longest: float  # [m] way in one direction before
    strayed: float  # [N] what readings in this direction have added to the offset: it may be friction until the next
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
    strayed=0.0,
    friction=0.0,
    friction_std=0.0,
    innovation_std=0.0,
    terms=Terms(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    covariance=NO_COVARIANCE,
    unexplained=Unexplained(),
    outliers=Outliers(0, 0.0, 0.0, NO_TERMS, False),
)
"""State before the first reading."""


class Reading(NamedTuple):
    """One reading of the friction."""

    stamp: int  # [ns]
    force: float  # [N] y
    direction: int  # d
    velocity: float  # [m/s] v
    way: float  # [m] from the reading before to this one
    friction: float  # [N] f of the law, > 0
    friction_std: float  # [N] of a new reading, by the seal file


@compilable
def friction_magnitude(terms: Terms, direction: float, speed: float, friction: float) -> float:
    """Friction of a rod that slides [N], never negative; at a ``direction`` of 0 the mean of both."""
    magnitude = terms.scale * friction + terms.coulomb + terms.misfit + terms.viscous * speed
    magnitude += direction * terms.asymmetry * friction
    return magnitude if magnitude > 0.0 else 0.0


@compilable
def expected(terms: Terms, reading: Reading) -> float:
    """Force sum that these terms let a reading expect [N]."""
    s, c, k, a, b, _, n, u = terms
    direction, law = reading.direction, reading.friction
    return direction * (s * law + c + u) + k * reading.velocity + a * law + b + n


@compilable
def _gains(covariance: Covariance, reading: Reading) -> Terms:
    """Covariance of each term with what a reading has to show [N times the unit of the term]."""
    c, k, a = float(reading.direction), reading.velocity, reading.friction
    s = c * a
    (
        ss, sc, sk, sa, sb, sg, sn, su, cc, ck, ca, cb, cg, cn, cu,
        kk, ka, kb, kg, kn, ku, aa, ab, ag, an, au,
        bb, bg, bn, bu, _, gn, gu, nn, nu, uu,
    ) = covariance  # fmt: skip
    return Terms(
        s * ss + c * sc + k * sk + a * sa + sb + sn + c * su,
        s * sc + c * cc + k * ck + a * ca + cb + cn + c * cu,
        s * sk + c * ck + k * kk + a * ka + kb + kn + c * ku,
        s * sa + c * ca + k * ka + a * aa + ab + an + c * au,
        s * sb + c * cb + k * kb + a * ab + bb + bn + c * bu,
        s * sg + c * cg + k * kg + a * ag + bg + gn + c * gu,
        s * sn + c * cn + k * kn + a * an + bn + nn + c * nu,
        s * su + c * cu + k * ku + a * au + bu + nu + c * uu,
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
    (
        ss, sc, sk, sa, sb, sg, sn, su, cc, ck, ca, cb, cg, cn, cu,
        kk, ka, kb, kg, kn, ku, aa, ab, ag, an, au,
        bb, bg, bn, bu, gg, gn, gu, nn, nu, uu,
    ) = known.covariance  # fmt: skip
    return Covariance(
        ss + walk * SCALE_PRIOR * SCALE_PRIOR, sc, sk, sa, sb + way * sg, sg, kept * sn, fits * su,
        cc + walk * coulomb * coulomb, ck, ca, cb + way * cg, cg, kept * cn, fits * cu,
        kk + walk * viscous * viscous, ka, kb + way * kg, kg, kept * kn, fits * ku,
        aa + walk * ASYMMETRY_PRIOR * ASYMMETRY_PRIOR, ab + way * ag, ag, kept * an, fits * au,
        bb + way * (2.0 * bg + way * gg) + elapsed * offset * offset, bg + way * gg, kept * (bn + way * gn),
        fits * (bu + way * gu), gg + curved * gradient * gradient, kept * gn, fits * gu,
        kept * kept * nn + (1.0 - kept * kept) * remainder * remainder, kept * fits * nu,
        fits * fits * uu + (1.0 - fits * fits) * misfit * misfit,
    )  # fmt: skip


@compilable
def updated(known: FrictionFilter, reading: Reading) -> FrictionFilter:
    """Filter after one more reading: predict, look for a step, correct, and follow what is left."""
    if known.stamp == NEVER:
        known = begun(reading)
    elapsed = between(0.0, (reading.stamp - known.stamp) * 1e-9, 3600.0)
    moved = elapsed if elapsed < LONGEST_STEP else LONGEST_STEP
    kept, law = REMAINDER_TIME / (REMAINDER_TIME + elapsed), reading.friction
    fits = MISFIT_RANGE / (MISFIT_RANGE + 2.0 * abs(law - known.friction) / (law + known.friction))
    stroke, longest, strayed = abs(reading.way), known.longest, 0.0
    if reading.direction == known.direction:
        stroke += known.stroke
        strayed = known.strayed
    elif known.stroke > longest:
        longest = known.stroke
    s, c, k, a, b, g, n, u = known.terms
    offset = b + reading.way * g
    terms = Terms(s, c, k, a, offset, g, kept * n, fits * u)
    covariance = _predicted(known, reading, fits, elapsed, moved, stroke if stroke > longest else longest)
    innovation = reading.force - expected(terms, reading)
    usual = known.unexplained.usual
    noise = known.unexplained.noise * (reading.friction if reading.friction > usual else usual)
    gains = _gains(covariance, reading)
    spread = expected(gains, reading)
    variance = spread + noise * noise

    outliers, steps = _outliers(known, reading.direction, terms, innovation, variance)
    unexplained = _followed(
        known, reading.friction, innovation + terms.remainder, innovation * innovation / variance, moved
    )
    if steps:
        terms = outliers.settled
        innovation = reading.force - expected(terms, reading)
        covariance = _freed(covariance, innovation, reading.direction * reading.friction)
        gains = _gains(covariance, reading)
        spread = expected(gains, reading)
    terms, covariance = _corrected(terms, covariance, gains, spread, innovation, noise)

    untold = terms.gradient * (stroke - longest) if stroke > longest else 0.0
    std = friction_std(covariance, unexplained.drift_square + untold * untold, reading)
    is_stepped = outliers.is_stepped and std > PROVEN * reading.friction
    if outliers.number == 0:
        outliers = Outliers(0, outliers.last, outliers.second, terms, is_stepped)
    return FrictionFilter(
        reading.stamp,
        reading.direction,
        abs(reading.velocity),
        stroke,
        longest,
        strayed + terms.offset - offset if longest > SHORTEST_STROKE else 0.0,
        reading.friction,
        std,
        math.sqrt(variance),
        terms,
        covariance,
        unexplained,
        outliers,
    )


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
    s, c, k, a, b, g, n, u = gains
    sv, cv, kv, av, bv, gv, nv, uv = (
        s / variance, c / variance, k / variance, a / variance, b / variance, g / variance, n / variance, u / variance,
    )  # fmt: skip
    (
        ss, sc, sk, sa, sb, sg, sn, su, cc, ck, ca, cb, cg, cn, cu,
        kk, ka, kb, kg, kn, ku, aa, ab, ag, an, au,
        bb, bg, bn, bu, gg, gn, gu, nn, nu, uu,
    ) = covariance  # fmt: skip
    scale, coulomb, viscous, asymmetry, offset, gradient, remainder, misfit = terms
    terms = Terms(
        scale + sv * innovation, coulomb + cv * innovation, viscous + kv * innovation, asymmetry + av * innovation,
        offset + bv * innovation, gradient + gv * innovation, remainder + nv * innovation, misfit + uv * innovation,
    )  # fmt: skip
    return terms, Covariance(
        ss - sv * s, sc - sv * c, sk - sv * k, sa - sv * a, sb - sv * b, sg - sv * g, sn - sv * n, su - sv * u,
        cc - cv * c, ck - cv * k, ca - cv * a, cb - cv * b, cg - cv * g, cn - cv * n, cu - cv * u,
        kk - kv * k, ka - kv * a, kb - kv * b, kg - kv * g, kn - kv * n, ku - kv * u,
        aa - av * a, ab - av * b, ag - av * g, an - av * n, au - av * u,
        bb - bv * b, bg - bv * g, bn - bv * n, bu - bv * u,
        gg - gv * g, gn - gv * n, gu - gv * u,
        nn - nv * n, nu - nv * u,
        uu - uv * u,
    )  # fmt: skip


@compilable
def _outliers(
    known: FrictionFilter, direction: int, terms: Terms, innovation: float, variance: float
) -> tuple[Outliers, bool]:
    """Outliers after an innovation [N], and whether they are a step of the load, or of the friction."""
    before, turns = known.outliers, direction != known.direction
    side = 0
    if innovation * innovation > OUTLIER * OUTLIER * variance:
        side = 1 if innovation > 0.0 else -1
    goes_on = before.number * side > 0
    leap = innovation if turns else innovation - before.second
    if not goes_on and leap * leap < LEAP * LEAP * variance:
        side = 0
    count = before.number + side if goes_on else side
    steps = abs(count) >= STEP_READINGS or (turns and abs(before.number) >= FEWEST_OUTLIERS)
    settled = before.settled if before.number != 0 else terms
    second = innovation if turns else before.last
    return Outliers(0 if steps else count, innovation, second, settled, before.is_stepped or steps), steps


@compilable
def _followed(known: FrictionFilter, friction: float, unexplained: float, excess: float, moved: float) -> Unexplained:
    """What is not explained after ``unexplained`` [N] more; ``excess`` is the squared innovation over its variance."""
    before = known.unexplained
    excess = excess if excess < OUTLIER * OUTLIER else OUTLIER * OUTLIER
    variance = before.noise * before.noise * (1.0 + moved / (moved + NOISE_TIME) * (excess - 1.0))
    noise = between(LEAST_NOISE, math.sqrt(variance), 1.0)
    if known.direction == 0:
        unexplained = 0.0  # all of it may be offset
    drift = before.drift + moved / (moved + DRIFT_TIME) * (unexplained - before.drift)
    share = moved / (moved + DRIFT_MEMORY)
    return Unexplained(
        noise,
        before.usual + moved / (moved + USUAL_TIME) * (friction - before.usual),
        drift,
        before.drift_square + share * (drift * drift - before.drift_square),
        before.square + share * (unexplained * unexplained - before.square),
    )


@compilable
def _freed(covariance: Covariance, innovation: float, force: float) -> Covariance:
    """Covariance after a step that one direction does not explain: it counts as load, but it may be of the friction.

    So the offset is freed, and a scale that the offset makes up for: the sum of both does not move the scale until the
    next reversal tells them apart.

    Args:
        covariance: Before the step.
        innovation: [N]
        force: Friction of the law with the sign of the direction [N].
    """
    scale_variance = (STEP_OF_FRICTION * innovation / force) * (STEP_OF_FRICTION * innovation / force)
    shared = -force * scale_variance
    freed = innovation * innovation + force * force * scale_variance
    return replace(covariance, ss=covariance.ss + scale_variance, sb=covariance.sb + shared, bb=covariance.bb + freed)


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

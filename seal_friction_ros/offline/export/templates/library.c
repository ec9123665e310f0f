/* ${mark} from the functions of the Python package, see the names of the functions. Do not edit. */
#include "${name}.h"
#include <float.h>
#include <math.h>
#include <string.h>
#if FLT_EVAL_METHOD != 0 || defined(__FAST_MATH__) || __FINITE_MATH_ONLY__
#error "double must be IEEE double precision, without -ffast-math and -ffinite-math-only"
#endif
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif
#ifdef __GNUC__ /* what no branch of this configuration reads */
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wunused-variable"
#pragma GCC diagnostic ignored "-Wunused-but-set-variable"
#endif

/* What C computes otherwise than Python: whole numbers wrap around as in compiled replay; of two numbers Python chooses
 * like this; a compiler turns a power of 2 that it knows into a product, which rounds differently. */
static inline int64_t add(int64_t a, int64_t b) { return (int64_t)((uint64_t)a + (uint64_t)b); }
static inline int64_t subtract(int64_t a, int64_t b) { return (int64_t)((uint64_t)a - (uint64_t)b); }
static inline int64_t multiply(int64_t a, int64_t b) { return (int64_t)((uint64_t)a * (uint64_t)b); }
static inline int64_t absolute(int64_t a) { return a < 0 ? (int64_t)(0 - (uint64_t)a) : a; }
static inline double smaller(double a, double b) { return b < a ? b : a; }
static inline double larger(double a, double b) { return b > a ? b : a; }
static inline int64_t smaller_integer(int64_t a, int64_t b) { return b < a ? b : a; }
static inline int64_t larger_integer(int64_t a, int64_t b) { return b > a ? b : a; }
static inline double power(double a, double b) { volatile double exponent = b; return pow(a, exponent); }

/* Number of knots up to x, as bisect_right. */
static inline int64_t last_place(const double *knots, int64_t n, double x)
{
    int64_t low = 0, high = n;
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (x < knots[middle]) high = middle; else low = middle + 1;
    }
    return low;
}

${types}
${functions}
static bool in_bounds(int64_t time) { return time >= -${latest} && time <= ${latest}; }

static void clear(${name}_answers *answers) { ${clear} }

#define RECEIVE(function) \
    clear(answers); \
    if (!in_bounds(message.stamp) || received < 0 || !in_bounds(received) || sent < 0 || !in_bounds(sent)) return false; \
    function(state, message, received, answers, sent); \
    return true;

static uint64_t bits_of_double(double value) { uint64_t bits; memcpy(&bits, &value, sizeof bits); return bits; }
static uint64_t bits_of_int64_t(int64_t value) { return (uint64_t)value; }
static uint64_t bits_of_bool(bool value) { return value; }
static double double_of(uint64_t bits) { double value; memcpy(&value, &bits, sizeof bits); return value; }
static int64_t int64_t_of(uint64_t bits) { return (int64_t)bits; }
static bool bool_of(uint64_t bits) { return bits != 0; }

static uint8_t *put(uint8_t *at, uint64_t bits)
{
    for (int i = 0; i < 8; i++) *at++ = (uint8_t)(bits >> (8 * i));
    return at;
}

static uint64_t take(const uint8_t **at)
{
    uint64_t bits = 0;
    for (int i = 0; i < 8; i++) bits |= (uint64_t)*(*at)++ << (8 * i);
    return bits;
}

const char *${name}_version(void) { return "${version}"; }
const char *${name}_hash(void) { return "${hash}"; }

void ${name}_init(${name}_pipeline_state *state)
{
    static const ${name}_pipeline_state first = ${first};
    *state = first;
}

void ${name}_reset(${name}_pipeline_state *state) { ${name}_init(state); }

bool ${name}_step(${name}_pipeline_state *state, const ${name}_loop_sample *sample, ${name}_answers *answers)
{
    clear(answers);
    if (sample->stamp < 0 || !in_bounds(sample->stamp)) {
        return false;
    }
    ${step}(state, *sample, answers);
    return true;
}

${bodies}
bool ${name}_is_tick_due(${name}_pipeline_state *state, int64_t now) { return ${due}(state, now); }

${name}_state_friction ${name}_friction_on_rod(${name}_rod_load load) { return ${friction}(load); }

/* Sum of the numbers of a saved state (FNV-1a), from a beginning that tells configurations and layouts apart. */
static uint64_t sum_of(const uint8_t *numbers)
{
    uint64_t sum = UINT64_C(0x${layout});
    for (int i = 0; i < ${NAME}_STATE_SIZE - 8; i++) sum = (sum ^ numbers[i]) * UINT64_C(1099511628211);
    return sum;
}

void ${name}_save(const ${name}_pipeline_state *state, uint8_t *bytes)
{
    uint8_t *at = bytes + 8;
${save}
    put(bytes, sum_of(bytes + 8));
}

bool ${name}_load(${name}_pipeline_state *state, const uint8_t *bytes)
{
    const uint8_t *at = bytes;
    const uint64_t sum = take(&at);
    if (sum != sum_of(at)) return false;
${load}
    return true;
}

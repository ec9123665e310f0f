/* A hostile integrator of two exported libraries, rod and piston: garbage into every function, in one thread and in
 * two. Exit code: the line of the first check that fails. The sanitizers see the rest. */
#include "piston.h"
#include "rod.h"
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#define CHECK(condition) do { if (!(condition)) exit(__LINE__ % 255 + 1); } while (0)
#define STEPS 20000

static const double REALS[] = {NAN, INFINITY, -INFINITY, 0.0, -0.0, 5e-324, -5e-324, 2e-308, 1e308, -1e308, 1e154, 3e6};
static const int64_t STAMPS[] = {0, 1, INT64_C(1) << 61, -(INT64_C(1) << 61), INT64_MIN, INT64_MAX, -1};

static uint64_t drawn(uint64_t *random) { return (*random = *random * 6364136223846793005u + 1442695040888963407u) >> 11; }

static double real(uint64_t *random, double usual)
{
    uint64_t bits = drawn(random) << 11 | drawn(random) >> 42;
    double any;
    memcpy(&any, &bits, sizeof any);
    switch (drawn(random) % 8) {
    case 0: return any;
    case 1: return REALS[drawn(random) % (sizeof REALS / sizeof *REALS)];
    default: return usual;
    }
}

static int64_t stamp(uint64_t *random, int64_t now)
{
    return drawn(random) % 16 ? now : STAMPS[drawn(random) % (sizeof STAMPS / sizeof *STAMPS)];
}

static void check(bool is_taken, const rod_answers *answers)
{
    CHECK(is_taken || !(answers->has_friction_estimate || answers->has_feed_forward));
    CHECK(!answers->has_friction_estimate || isfinite(answers->friction_estimate.friction_force));
    CHECK(!answers->has_friction_estimate || isfinite(answers->friction_estimate.coulomb_friction_std));
    CHECK(!answers->has_feed_forward || isfinite(answers->feed_forward.force));
}

/* One call with garbage, of any function; what the next one begins with is in state. */
static void call(rod_pipeline_state *state, uint64_t *random, int64_t now)
{
    double v = 0.05 * sin((double)now * 2e-9);
    int64_t at = stamp(random, now), received = stamp(random, now), sent = stamp(random, received);
    rod_answers answers;
    memset(&answers, 0xa5, sizeof answers);
    bool is_taken = true;
    switch (drawn(random) % 10) {
    case 0: is_taken = rod_receive_pressure(state, (rod_pressure){at, real(random, 3e6), real(random, 1e6)}, received, sent, &answers); break;
    case 1: is_taken = rod_receive_force(state, (rod_force){at, real(random, 40.0)}, received, sent, &answers); break;
    case 2: is_taken = rod_receive_temperature(state, (rod_temperature){at, real(random, 20.0), 0.0}, received, sent, &answers); break;
    case 3: is_taken = rod_receive_servo_reference(state, (rod_servo_reference){at, 0.0, real(random, v), real(random, 0.1)}, received, sent, &answers); break;
    case 4: is_taken = rod_receive_watchdog_tick(state, (rod_watchdog_tick){at, real(random, 0.02)}, received, sent, &answers); break;
    case 5: is_taken = rod_receive_clock(state, (rod_clock){at}, received, sent, &answers); break;
    case 6: is_taken = rod_receive_velocity(state, (rod_velocity){at, real(random, v)}, received, sent, &answers); break;
    case 7: {
        rod_state_friction found = rod_friction_on_rod((rod_rod_load){real(random, v), real(random, 3e6), real(random, 1e6), real(random, 40.0), real(random, 20.0)});
        CHECK(isfinite(found.friction_force));
        rod_is_tick_due(state, received);
        return;
    }
    default: {
        rod_loop_sample sample = {at, real(random, v), real(random, 3e6), real(random, 1e6), real(random, 800.0 * v), real(random, v), real(random, 0.1), real(random, 20.0)};
        is_taken = rod_step(state, &sample, &answers);
    }
    }
    check(is_taken, &answers);
}

static void *run(void *bytes)
{
    rod_pipeline_state state;
    uint64_t random = 7;
    rod_init(&state);
    for (int i = 0; i < STEPS; i++) {
        call(&state, &random, 1000000 * (int64_t)i);
        if (i == STEPS / 2) rod_init(&state); /* again, while it runs */
    }
    rod_save(&state, bytes);
    return bytes;
}

static void *run_piston(void *bytes)
{
    piston_pipeline_state state;
    piston_init(&state);
    for (int i = 0; i < STEPS; i++) {
        piston_loop_sample sample = {1000000 * (int64_t)i, 0.05, 3e6, 1e6, 40.0, 0.05, 0.0, NAN};
        piston_answers answers;
        CHECK(piston_step(&state, &sample, &answers));
    }
    piston_save(&state, bytes);
    return bytes;
}

/* A state that is cut, changed in one byte, or of the other library is refused, and changes nothing. */
static void load_garbage(const uint8_t *good, const uint8_t *foreign)
{
    static rod_pipeline_state state;
    static uint8_t bad[ROD_STATE_SIZE], before[ROD_STATE_SIZE], after[ROD_STATE_SIZE];
    CHECK(rod_load(&state, good));
    rod_save(&state, before);
    CHECK(memcmp(before, good, sizeof before) == 0);
    memcpy(bad, foreign, sizeof bad < PISTON_STATE_SIZE ? sizeof bad : PISTON_STATE_SIZE);
    CHECK(!rod_load(&state, bad));
    for (size_t place = 0; place < sizeof bad; place++) {
        memcpy(bad, good, sizeof bad);
        bad[place] ^= 1u << place % 8;
        CHECK(!rod_load(&state, bad));
        memcpy(bad, good, sizeof bad);
        memset(bad + place, 0, sizeof bad - place);
        CHECK(!rod_load(&state, bad) || memcmp(bad, good, sizeof bad) == 0);
    }
    rod_save(&state, after);
    CHECK(memcmp(before, after, sizeof before) == 0);
}

int main(void)
{
    static uint8_t alone[ROD_STATE_SIZE], first[ROD_STATE_SIZE], second[ROD_STATE_SIZE], other[PISTON_STATE_SIZE];
    pthread_t threads[3];
    run(alone);
    pthread_create(threads, NULL, run, first);
    pthread_create(threads + 1, NULL, run, second);
    pthread_create(threads + 2, NULL, run_piston, other);
    for (int i = 0; i < 3; i++) pthread_join(threads[i], NULL);
    CHECK(memcmp(alone, first, sizeof alone) == 0 && memcmp(alone, second, sizeof alone) == 0);
    CHECK(strcmp(rod_hash(), piston_hash()) != 0);
    load_garbage(alone, other);
    return 0;
}

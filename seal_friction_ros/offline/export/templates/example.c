/* ${mark}: samples of a CSV in, estimate and feed-forward out, to the last bit.
 * Columns: stamp [ns], then the other members of ${name}_loop_sample in their order; an empty field or nan: no sample. */
#include "${name}.h"
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static double next_of(char **text)
{
    char *end;
    double value = strtod(*text, &end);
    if (end == *text) value = NAN;
    end = strchr(end, ',');
    *text = end ? end + 1 : *text + strlen(*text);
    return value;
}

int main(int argc, char **argv)
{
    static ${name}_pipeline_state state;
    ${name}_loop_sample sample;
    ${name}_answers answers;
    char line[1024];
    FILE *file = argc > 1 ? fopen(argv[1], "r") : stdin;
    if (!file || !fgets(line, sizeof line, file)) return 2; /* the first line has the names */
    ${name}_init(&state);
    printf("stamp,friction_force,coulomb_friction,coulomb_friction_std,state,status,feedforward_force\n");
    while (fgets(line, sizeof line, file)) {
        char *text = strchr(line, ',');
        if (!text) continue;
        *text++ = '\0';
        sample.stamp = strpbrk(line, ".eE") ? llround(strtod(line, NULL)) : strtoll(line, NULL, 10); /* 1e9, too */
        sample.velocity = next_of(&text);
        sample.pressure_a = next_of(&text);
        sample.pressure_b = next_of(&text);
        sample.force_sum = next_of(&text);
        sample.reference_velocity = next_of(&text);
        sample.reference_acceleration = next_of(&text);
        sample.temperature = next_of(&text);
        if (!${name}_step(&state, &sample, &answers)) return 1;
        printf("%" PRId64 ",%.17g,%.17g,%.17g,%" PRId64 ",%" PRId64 ",%.17g\n", answers.friction_estimate.stamp,
               answers.friction_estimate.friction_force, answers.friction_estimate.coulomb_friction,
               answers.friction_estimate.coulomb_friction_std, answers.friction_estimate.state,
               answers.friction_estimate.status, answers.has_feed_forward ? answers.feed_forward.force : 0.0);
    }
    return 0;
}

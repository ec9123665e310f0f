/* ${mark}: the friction estimator, version ${version}. Units are SI, pressures gauge, stamps ns.
 *
 * One ${name}_pipeline_state for each actuator, without hidden state: functions may run in several threads on
 * different states. No function allocates, blocks, or fails for any value of a sensor. */
#ifndef ${NAME}_H
#define ${NAME}_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

#define ${NAME}_NEVER INT64_MIN /* stamp of what has not come */
#define ${NAME}_STATE_SIZE (8 + 8 * ${state_size}) /* [bytes] of a saved state */

${enums}

${structs}
/* Before the first sample, and back to there. */
void ${name}_init(${name}_pipeline_state *state);
void ${name}_reset(${name}_pipeline_state *state);

/* One step of a loop: sample in, estimate and feed-forward out. False: the stamp is negative or beyond 2^61 ns, and
 * nothing has changed. */
bool ${name}_step(${name}_pipeline_state *state, const ${name}_loop_sample *sample, ${name}_answers *answers);

/* One message at a time, for inputs with rates of their own: when it was received and sent [ns], on one clock. */
${receivers}
bool ${name}_is_tick_due(${name}_pipeline_state *state, int64_t now);

/* Friction of the seals on a rod, without adaptation: for a simulated plant. */
${name}_state_friction ${name}_friction_on_rod(${name}_rod_load load);

/* A state as ${NAME}_STATE_SIZE bytes, the same on every machine. load reads as many, and refuses those of another
 * configuration or layout, or damaged ones; the state is then as before. */
void ${name}_save(const ${name}_pipeline_state *state, uint8_t *bytes);
bool ${name}_load(${name}_pipeline_state *state, const uint8_t *bytes);

const char *${name}_version(void); /* of the package and of the algorithm */
const char *${name}_hash(void);    /* SHA-256 of configuration.json: seal files and settings */

#ifdef __cplusplus
}
#endif
#endif

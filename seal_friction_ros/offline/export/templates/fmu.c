/* The interface of FMI ${fmi}.0 on ${name}; its types, as the standard has them, are written out here. */
#include "${name}.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#define ESTIMATOR ${is_estimator}
#define INPUTS ${inputs}

enum { OK = 0, ERROR = 3 };

typedef struct {
    ${name}_pipeline_state state;
    ${name}_loop_sample sample;
    ${name}_answers answers;
    ${name}_rod_load load;
    ${name}_state_friction friction;
    double time;
} instance;

static int reset(instance *self)
{
    memset(self, 0, sizeof *self);
    ${name}_init(&self->state);
    ${starts}
    return OK;
}

static instance *instantiate(const char *token)
{
    instance *self = token && strcmp(token, ${name}_hash()) == 0 ? malloc(sizeof *self) : NULL;
    if (self) reset(self);
    return self;
}

static double *real_at(instance *self, uint32_t reference)
{
    switch (reference) {
    case 0: return &self->time;
${reals}    default: return NULL;
    }
}

static int64_t *integer_at(instance *self, uint32_t reference)
{
    switch (reference) {
${integers}    default: return NULL;
    }
}

static int get_reals(instance *self, const uint32_t *references, size_t n, double *values)
{
    if (!ESTIMATOR) self->friction = ${name}_friction_on_rod(self->load);
    for (size_t i = 0; i < n; i++) {
        const double *place = real_at(self, references[i]);
        if (!place) return ERROR;
        values[i] = *place;
    }
    return OK;
}

static int set_reals(instance *self, const uint32_t *references, size_t n, const double *values)
{
    for (size_t i = 0; i < n; i++) {
        if (references[i] < 1 || references[i] > INPUTS) return ERROR;
        *real_at(self, references[i]) = values[i];
    }
    return OK;
}

/* Integers of FMI 2.0 have 32 bits. */
#define GET_INTEGERS(type) \
    if (!ESTIMATOR) ((instance *)self)->friction = ${name}_friction_on_rod(((instance *)self)->load); \
    for (size_t i = 0; i < n; i++) { \
        const int64_t *place = integer_at(self, references[i]); \
        if (!place) return ERROR; \
        values[i] = (type)*place; \
    } \
    return OK;

static int step(instance *self, double time, double size)
{
    self->sample.stamp = isfinite(time) && fabs(time) < 1e9 ? llround(time * 1e9) : -1;
    if (ESTIMATOR && !${name}_step(&self->state, &self->sample, &self->answers)) return ERROR;
    self->time = time + size;
    return OK;
}

/* What a tool may look for and nothing here needs: done, or not to be had. */
#define DONE(function) int function(void) { return OK; }
#define REFUSED(function) int function(void) { return ERROR; }

#if ${fmi} == 2
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources, const void *callbacks,
                      int visible, int logging)
{
    (void)name, (void)type, (void)resources, (void)callbacks, (void)visible, (void)logging;
    return instantiate(token);
}
void fmi2FreeInstance(void *self) { free(self); }
int fmi2Reset(void *self) { return reset(self); }
int fmi2GetReal(void *self, const uint32_t *r, size_t n, double *v) { return get_reals(self, r, n, v); }
int fmi2SetReal(void *self, const uint32_t *r, size_t n, const double *v) { return set_reals(self, r, n, v); }
int fmi2GetInteger(void *self, const uint32_t *references, size_t n, int *values) { GET_INTEGERS(int) }
int fmi2DoStep(void *self, double time, double size, int none_back) { (void)none_back; return step(self, time, size); }
int fmi2SetTime(void *self, double time) { ((instance *)self)->time = time; return OK; }
int fmi2CompletedIntegratorStep(void *self, int none_back, int *enter, int *stop)
{
    (void)self, (void)none_back;
    *enter = *stop = 0;
    return OK;
}
int fmi2NewDiscreteStates(void *self, void *information) { (void)self; memset(information, 0, 5 * sizeof(int)); return OK; }
DONE(fmi2SetDebugLogging) DONE(fmi2SetupExperiment) DONE(fmi2EnterInitializationMode)
DONE(fmi2ExitInitializationMode) DONE(fmi2Terminate) DONE(fmi2EnterEventMode) DONE(fmi2EnterContinuousTimeMode)
DONE(fmi2SetContinuousStates) DONE(fmi2GetDerivatives) DONE(fmi2GetEventIndicators) DONE(fmi2GetContinuousStates)
DONE(fmi2GetNominalsOfContinuousStates)
REFUSED(fmi2GetBoolean) REFUSED(fmi2GetString) REFUSED(fmi2SetInteger) REFUSED(fmi2SetBoolean) REFUSED(fmi2SetString)
REFUSED(fmi2GetFMUstate) REFUSED(fmi2SetFMUstate) REFUSED(fmi2FreeFMUstate) REFUSED(fmi2SerializedFMUstateSize)
REFUSED(fmi2SerializeFMUstate) REFUSED(fmi2DeSerializeFMUstate) REFUSED(fmi2GetDirectionalDerivative)
REFUSED(fmi2SetRealInputDerivatives) REFUSED(fmi2GetRealOutputDerivatives) REFUSED(fmi2CancelStep)
REFUSED(fmi2GetStatus) REFUSED(fmi2GetRealStatus) REFUSED(fmi2GetIntegerStatus) REFUSED(fmi2GetBooleanStatus)
REFUSED(fmi2GetStringStatus)
#else
const char *fmi3GetVersion(void) { return "3.0"; }
void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                   bool logging, void *environment, void *log)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    return instantiate(token);
}
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                  bool logging, bool events, bool early, const uint32_t *required, size_t n,
                                  void *environment, void *log, void *update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)required, (void)n;
    (void)environment, (void)log, (void)update;
    return instantiate(token);
}
void *fmi3InstantiateScheduledExecution(void) { return NULL; }
void fmi3FreeInstance(void *self) { free(self); }
int fmi3Reset(void *self) { return reset(self); }
int fmi3GetFloat64(void *self, const uint32_t *r, size_t n, double *v, size_t m) { (void)m; return get_reals(self, r, n, v); }
int fmi3SetFloat64(void *self, const uint32_t *r, size_t n, const double *v, size_t m) { (void)m; return set_reals(self, r, n, v); }
int fmi3GetInt64(void *self, const uint32_t *references, size_t n, int64_t *values, size_t m)
{
    (void)m;
    GET_INTEGERS(int64_t)
}
int fmi3DoStep(void *self, double time, double size, bool none_back, bool *event, bool *stop, bool *early, double *last)
{
    (void)none_back;
    *event = *stop = *early = false;
    const int status = step(self, time, size);
    *last = status == OK ? time + size : time;
    return status;
}
int fmi3SetTime(void *self, double time) { ((instance *)self)->time = time; return OK; }
int fmi3CompletedIntegratorStep(void *self, bool none_back, bool *enter, bool *stop)
{
    (void)self, (void)none_back;
    *enter = *stop = false;
    return OK;
}
int fmi3UpdateDiscreteStates(void *self, bool *again, bool *stop, bool *nominals, bool *values, bool *next, double *time)
{
    (void)self, (void)time;
    *again = *stop = *nominals = *values = *next = false;
    return OK;
}
int fmi3GetNumberOfEventIndicators(void *self, size_t *n) { (void)self; *n = 0; return OK; }
int fmi3GetNumberOfContinuousStates(void *self, size_t *n) { (void)self; *n = 0; return OK; }
DONE(fmi3SetDebugLogging) DONE(fmi3EnterInitializationMode) DONE(fmi3ExitInitializationMode) DONE(fmi3EnterEventMode)
DONE(fmi3Terminate) DONE(fmi3EnterConfigurationMode) DONE(fmi3ExitConfigurationMode) DONE(fmi3EvaluateDiscreteStates)
DONE(fmi3EnterContinuousTimeMode) DONE(fmi3EnterStepMode) DONE(fmi3SetContinuousStates)
DONE(fmi3GetContinuousStateDerivatives) DONE(fmi3GetEventIndicators) DONE(fmi3GetContinuousStates)
DONE(fmi3GetNominalsOfContinuousStates)
REFUSED(fmi3GetFloat32) REFUSED(fmi3GetInt8) REFUSED(fmi3GetUInt8) REFUSED(fmi3GetInt16) REFUSED(fmi3GetUInt16)
REFUSED(fmi3GetInt32) REFUSED(fmi3GetUInt32) REFUSED(fmi3GetUInt64) REFUSED(fmi3GetBoolean) REFUSED(fmi3GetString)
REFUSED(fmi3GetBinary) REFUSED(fmi3GetClock) REFUSED(fmi3SetFloat32) REFUSED(fmi3SetInt8) REFUSED(fmi3SetUInt8)
REFUSED(fmi3SetInt16) REFUSED(fmi3SetUInt16) REFUSED(fmi3SetInt32) REFUSED(fmi3SetUInt32) REFUSED(fmi3SetInt64)
REFUSED(fmi3SetUInt64) REFUSED(fmi3SetBoolean) REFUSED(fmi3SetString) REFUSED(fmi3SetBinary) REFUSED(fmi3SetClock)
REFUSED(fmi3GetNumberOfVariableDependencies) REFUSED(fmi3GetVariableDependencies) REFUSED(fmi3GetFMUState)
REFUSED(fmi3SetFMUState) REFUSED(fmi3FreeFMUState) REFUSED(fmi3SerializedFMUStateSize)
REFUSED(fmi3SerializeFMUState) REFUSED(fmi3DeserializeFMUState) REFUSED(fmi3GetDirectionalDerivative)
REFUSED(fmi3GetAdjointDerivative) REFUSED(fmi3GetIntervalDecimal) REFUSED(fmi3GetIntervalFraction)
REFUSED(fmi3GetShiftDecimal) REFUSED(fmi3GetShiftFraction) REFUSED(fmi3SetIntervalDecimal)
REFUSED(fmi3SetIntervalFraction) REFUSED(fmi3SetShiftDecimal) REFUSED(fmi3SetShiftFraction)
REFUSED(fmi3GetOutputDerivatives) REFUSED(fmi3ActivateModelPartition)
#endif

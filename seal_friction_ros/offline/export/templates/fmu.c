/* The interface of FMI ${fmi}.0 on ${name}; its types, as the standard has them, are written out here. Arguments that a
 * tool passes beyond those of a function here are not needed. */
#include "${name}.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#define ESTIMATOR ${is_estimator}

enum { OK = 0, ERROR = 3 };
typedef ${flag} flag;

typedef struct {
    ${name}_pipeline_state state;
    ${name}_loop_sample sample;
    ${name}_answers answers;
    ${name}_rod_load load;
    ${name}_state_friction friction;
    double time;
} instance;

static int64_t *integer_at(instance *self, uint32_t reference)
{
    switch (reference) {
${integers}    default: return NULL;
    }
}

static double *real_at(instance *self, uint32_t reference)
{
    switch (reference) {
${reals}    default: return NULL;
    }
}

#define GET(name, type, place_at) \
    int fmi${fmi}Get##name(void *self, const uint32_t *references, size_t n, type *values) \
    { \
        for (size_t i = 0; i < n; i++) { \
            if (!place_at(self, references[i])) return ERROR; \
            values[i] = (type)*place_at(self, references[i]); \
        } \
        return OK; \
    }
GET(${real}, double, real_at)
GET(${integer}, ${integer_type}, integer_at)

int fmi${fmi}Set${real}(instance *self, const uint32_t *references, size_t n, const double *values)
{
    for (size_t i = 0; i < n; i++) {
        if (references[i] < 1 || references[i] > ${inputs}) return ERROR;
        *real_at(self, references[i]) = values[i];
    }
    self->friction = ${name}_friction_on_rod(self->load);
    return OK;
}

int fmi${fmi}Reset(instance *self)
{
    memset(self, 0, sizeof *self);
    ${name}_init(&self->state);
    ${starts}
    self->friction = ${name}_friction_on_rod(self->load);
    return OK;
}

static instance *instantiate(const char *token)
{
    instance *self = token && strcmp(token, ${name}_hash()) == 0 ? malloc(sizeof *self) : NULL;
    if (self) fmi${fmi}Reset(self);
    return self;
}

void fmi${fmi}FreeInstance(void *self) { free(self); }

static int step(instance *self, double time, double size)
{
    self->sample.stamp = isfinite(time) && fabs(time) < 1e9 ? llround(time * 1e9) : -1;
    if (ESTIMATOR && !${name}_step(&self->state, &self->sample, &self->answers)) return ERROR;
    self->time = time + size;
    return OK;
}

int fmi${fmi}SetTime(instance *self, double time) { self->time = time; return OK; }
int fmi${fmi}CompletedIntegratorStep(void *self, flag none_back, flag *enter, flag *stop)
{
    (void)self, (void)none_back;
    *enter = *stop = 0;
    return OK;
}
const char *fmi${fmi}GetVersion(void) { return "${fmi}.0"; }

/* What a tool may look for and nothing here needs: done, or not to be had. */
#define DONE(name) int fmi${fmi}##name(void) { return OK; }
#define REFUSED(name) int fmi${fmi}##name(void) { return ERROR; }
#define NEITHER(type) REFUSED(Get##type) REFUSED(Set##type)
DONE(SetDebugLogging) DONE(EnterInitializationMode) DONE(ExitInitializationMode) DONE(Terminate) DONE(EnterEventMode)
DONE(EnterContinuousTimeMode) DONE(GetContinuousStates) DONE(SetContinuousStates) DONE(GetEventIndicators)
DONE(GetNominalsOfContinuousStates)
NEITHER(Boolean) NEITHER(String) REFUSED(Set${integer}) REFUSED(GetDirectionalDerivative)

#if ${fmi} == 2
const char *fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate(const char *name, int type, const char *token) { (void)name, (void)type; return instantiate(token); }
int fmi2DoStep(void *self, double time, double size) { return step(self, time, size); }
int fmi2NewDiscreteStates(void *self, void *information) { (void)self; memset(information, 0, 5 * sizeof(int)); return OK; }
DONE(SetupExperiment) DONE(GetDerivatives) NEITHER(FMUstate) REFUSED(FreeFMUstate) REFUSED(SerializedFMUstateSize)
REFUSED(SerializeFMUstate) REFUSED(DeSerializeFMUstate) REFUSED(SetRealInputDerivatives) REFUSED(CancelStep)
REFUSED(GetRealOutputDerivatives) REFUSED(GetStatus) REFUSED(GetRealStatus) REFUSED(GetIntegerStatus)
REFUSED(GetBooleanStatus) REFUSED(GetStringStatus)
#else
void *fmi3InstantiateModelExchange(const char *name, const char *token) { (void)name; return instantiate(token); }
void *fmi3InstantiateCoSimulation(const char *name, const char *token) { (void)name; return instantiate(token); }
void *fmi3InstantiateScheduledExecution(void) { return NULL; }
int fmi3DoStep(void *self, double time, double size, bool none_back, bool *event, bool *stop, bool *early, double *last)
{
    (void)none_back;
    *event = *stop = *early = false;
    const int status = step(self, time, size);
    *last = status == OK ? time + size : time;
    return status;
}
int fmi3UpdateDiscreteStates(void *self, bool *again, bool *stop, bool *nominals, bool *values, bool *next)
{
    (void)self;
    *again = *stop = *nominals = *values = *next = false;
    return OK;
}
int fmi3GetNumberOfEventIndicators(void *self, size_t *n) { (void)self; *n = 0; return OK; }
int fmi3GetNumberOfContinuousStates(void *self, size_t *n) { (void)self; *n = 0; return OK; }
DONE(EnterConfigurationMode) DONE(ExitConfigurationMode) DONE(EvaluateDiscreteStates) DONE(EnterStepMode)
DONE(GetContinuousStateDerivatives)
NEITHER(Float32) NEITHER(Int8) NEITHER(UInt8) NEITHER(Int16) NEITHER(UInt16) NEITHER(Int32) NEITHER(UInt32)
NEITHER(UInt64) NEITHER(Binary) NEITHER(Clock) NEITHER(FMUState) NEITHER(IntervalDecimal) NEITHER(IntervalFraction)
NEITHER(ShiftDecimal) NEITHER(ShiftFraction) REFUSED(GetNumberOfVariableDependencies)
REFUSED(GetVariableDependencies) REFUSED(FreeFMUState) REFUSED(SerializedFMUStateSize) REFUSED(SerializeFMUState)
REFUSED(DeserializeFMUState) REFUSED(GetAdjointDerivative) REFUSED(GetOutputDerivatives)
REFUSED(ActivateModelPartition)
#endif

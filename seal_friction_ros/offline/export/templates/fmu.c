/* The interface of FMI ${fmi}.0 on ${name}. Types and parameters are those of the headers of the standard; these may be
 * included before, so that a compiler compares them. */
#include "${name}.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#define ESTIMATOR ${is_estimator}
#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#ifndef fmi${fmi}FunctionTypes_h
#if ${fmi} == 2
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct { int need_update, terminate, nominals_changed, values_changed, has_next; double next; } fmi2EventInfo;
typedef struct callbacks fmi2CallbackFunctions;
#else
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(void *, fmi3Status, const char *, const char *);
typedef void (*fmi3ClockUpdateCallback)(void *);
typedef void (*fmi3IntermediateUpdateCallback)(void *, double, bool, bool, bool, bool, bool *, double *);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
#endif
#endif
typedef ${flag} flag;
typedef const char *text;

/* Parameters: of the instance alone, with values of references, with an array of numbers. */
#define SELF void *self
#define REFERENCES SELF, const uint32_t *references, size_t n
#if ${fmi} == 2
#define VALUES(type) REFERENCES, type *values
#else
#define VALUES(type) REFERENCES, type *values, size_t n_values
#endif
#define NUMBERS(type) SELF, type *numbers, size_t n
#define EXPERIMENT SELF, flag has_tolerance, double tolerance, double start, flag has_stop, double stop

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

static void evaluate(instance *self) { if (!ESTIMATOR) self->friction = ${name}_friction_on_rod(self->load); }

static fmi${fmi}Status step(instance *self, double time, double size)
{
    self->sample.stamp = isfinite(time) && fabs(time) < 1e9 ? llround(time * 1e9) : -1;
    if (ESTIMATOR && !${name}_step(&self->state, &self->sample, &self->answers)) return fmi${fmi}Error;
    self->time = time + size;
    return fmi${fmi}OK;
}

#define GET(name, type, place_at) \
    fmi${fmi}Status fmi${fmi}Get##name(VALUES(type)) \
    { \
        for (size_t i = 0; i < n; i++) { \
            if (!place_at(self, references[i])) return fmi${fmi}Error; \
            values[i] = (type)*place_at(self, references[i]); \
        } \
        return fmi${fmi}OK; \
    }
GET(${real}, double, real_at)
GET(${integer}, ${integer_type}, integer_at)

fmi${fmi}Status fmi${fmi}Set${real}(VALUES(const double))
{
    for (size_t i = 0; i < n; i++) {
        if (references[i] < 1 || references[i] > ${inputs}) return fmi${fmi}Error;
    }
    for (size_t i = 0; i < n; i++) *real_at(self, references[i]) = values[i];
    evaluate(self);
    return fmi${fmi}OK;
}

static fmi${fmi}Status reset(instance *self)
{
    memset(self, 0, sizeof *self);
    ${name}_init(&self->state);
    ${starts}
    evaluate(self);
    return fmi${fmi}OK;
}

static instance *instantiate(text token)
{
    instance *self = token && strcmp(token, ${name}_hash()) == 0 ? malloc(sizeof *self) : NULL;
    if (self) reset(self);
    return self;
}

fmi${fmi}Status fmi${fmi}Reset(SELF) { return reset(self); }
void fmi${fmi}FreeInstance(SELF) { free(self); }

fmi${fmi}Status fmi${fmi}SetTime(SELF, double time) { ((instance *)self)->time = time; return fmi${fmi}OK; }
fmi${fmi}Status fmi${fmi}CompletedIntegratorStep(SELF, flag none_back, flag *enter, flag *stop)
{
    *enter = *stop = 0;
    return fmi${fmi}OK;
}
text fmi${fmi}GetVersion(void) { return "${fmi}.0"; }

/* What a tool may look for and nothing here needs: done, or not to be had. */
#define DONE(name, ...) fmi${fmi}Status fmi${fmi}##name(__VA_ARGS__) { return fmi${fmi}OK; }
#define REFUSED(name, ...) fmi${fmi}Status fmi${fmi}##name(__VA_ARGS__) { return fmi${fmi}Error; }
#define NEITHER(name, type) REFUSED(Get##name, VALUES(type)) REFUSED(Set##name, VALUES(const type))
#define NO_STATE(State, Deserialize, byte) \
    REFUSED(Get##State, SELF, void **state) REFUSED(Set##State, SELF, void *state) \
    REFUSED(Free##State, SELF, void **state) REFUSED(Serialized##State##Size, SELF, void *state, size_t *size) \
    REFUSED(Serialize##State, SELF, void *state, byte *bytes, size_t size) \
    REFUSED(Deserialize##State, SELF, const byte *bytes, size_t size, void **state)
#define DERIVATIVE SELF, const uint32_t *of, size_t n_of, const uint32_t *by, size_t n_by
DONE(SetDebugLogging, SELF, flag is_on, size_t n, const text *categories)
DONE(ExitInitializationMode, SELF) DONE(Terminate, SELF) DONE(EnterEventMode, SELF) DONE(EnterContinuousTimeMode, SELF)
DONE(GetContinuousStates, NUMBERS(double)) DONE(SetContinuousStates, NUMBERS(const double))
DONE(GetEventIndicators, NUMBERS(double)) DONE(GetNominalsOfContinuousStates, NUMBERS(double))
NEITHER(Boolean, flag) NEITHER(String, text) REFUSED(Set${integer}, VALUES(const ${integer_type}))

#if ${fmi} == 2
text fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate(text name, fmi2Type type, text token, text resources, const fmi2CallbackFunctions *functions,
                      int is_visible, int is_logging)
{
    return instantiate(token);
}
fmi2Status fmi2DoStep(SELF, double time, double size, int none_back) { return step(self, time, size); }
fmi2Status fmi2NewDiscreteStates(SELF, fmi2EventInfo *information)
{
    memset(information, 0, sizeof *information);
    return fmi2OK;
}
DONE(SetupExperiment, EXPERIMENT) DONE(EnterInitializationMode, SELF) DONE(GetDerivatives, NUMBERS(double))
NO_STATE(FMUstate, DeSerialize, char)
REFUSED(GetDirectionalDerivative, DERIVATIVE, const double *seed, double *found)
REFUSED(SetRealInputDerivatives, REFERENCES, const int *orders, const double *values)
REFUSED(GetRealOutputDerivatives, REFERENCES, const int *orders, double *values)
REFUSED(CancelStep, SELF) REFUSED(GetStatus, SELF, fmi2StatusKind kind, fmi2Status *value)
REFUSED(GetRealStatus, SELF, fmi2StatusKind kind, double *value)
REFUSED(GetIntegerStatus, SELF, fmi2StatusKind kind, int *value)
REFUSED(GetBooleanStatus, SELF, fmi2StatusKind kind, int *value)
REFUSED(GetStringStatus, SELF, fmi2StatusKind kind, text *value)
#else
#define START text name, text token, text resources, bool is_visible, bool is_logging
void *fmi3InstantiateModelExchange(START, void *environment, fmi3LogMessageCallback log) { return instantiate(token); }
void *fmi3InstantiateCoSimulation(START, bool has_events, bool may_return_early, const uint32_t *intermediate, size_t n,
                                  void *environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    return instantiate(token);
}
void *fmi3InstantiateScheduledExecution(START, void *environment, fmi3LogMessageCallback log,
                                        fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                        fmi3UnlockPreemptionCallback unlock)
{
    return NULL;
}
fmi3Status fmi3DoStep(SELF, double time, double size, bool none_back, bool *event, bool *stop, bool *early, double *last)
{
    *event = *stop = *early = false;
    const fmi3Status status = step(self, time, size);
    *last = status == fmi3OK ? time + size : time;
    return status;
}
fmi3Status fmi3UpdateDiscreteStates(SELF, bool *again, bool *stop, bool *nominals, bool *values, bool *has_next,
                                    double *next)
{
    *again = *stop = *nominals = *values = *has_next = false;
    return fmi3OK;
}
fmi3Status fmi3GetNumberOfEventIndicators(SELF, size_t *n) { *n = 0; return fmi3OK; }
fmi3Status fmi3GetNumberOfContinuousStates(SELF, size_t *n) { *n = 0; return fmi3OK; }
DONE(EnterInitializationMode, EXPERIMENT) DONE(EnterConfigurationMode, SELF) DONE(ExitConfigurationMode, SELF)
DONE(EvaluateDiscreteStates, SELF) DONE(EnterStepMode, SELF) DONE(GetContinuousStateDerivatives, NUMBERS(double))
NEITHER(Float32, float) NEITHER(Int8, int8_t) NEITHER(UInt8, uint8_t) NEITHER(Int16, int16_t) NEITHER(UInt16, uint16_t)
NEITHER(Int32, int32_t) NEITHER(UInt32, uint32_t) NEITHER(UInt64, uint64_t) NO_STATE(FMUState, Deserialize, uint8_t)
typedef const uint8_t *binary;
REFUSED(GetBinary, REFERENCES, size_t *sizes, binary *values, size_t n_values)
REFUSED(SetBinary, REFERENCES, const size_t *sizes, const binary *values, size_t n_values)
REFUSED(GetClock, REFERENCES, bool *values) REFUSED(SetClock, REFERENCES, const bool *values)
REFUSED(GetIntervalDecimal, REFERENCES, double *intervals, fmi3IntervalQualifier *qualifiers)
REFUSED(SetIntervalDecimal, REFERENCES, const double *intervals)
REFUSED(GetIntervalFraction, REFERENCES, uint64_t *counters, uint64_t *resolutions, fmi3IntervalQualifier *qualifiers)
REFUSED(SetIntervalFraction, REFERENCES, const uint64_t *counters, const uint64_t *resolutions)
REFUSED(GetShiftDecimal, REFERENCES, double *shifts) REFUSED(SetShiftDecimal, REFERENCES, const double *shifts)
REFUSED(GetShiftFraction, REFERENCES, uint64_t *counters, uint64_t *resolutions)
REFUSED(SetShiftFraction, REFERENCES, const uint64_t *counters, const uint64_t *resolutions)
REFUSED(GetNumberOfVariableDependencies, SELF, uint32_t reference, size_t *n)
REFUSED(GetVariableDependencies, SELF, uint32_t of, size_t *elements, uint32_t *independents, size_t *elements_of,
        fmi3DependencyKind *kinds, size_t n)
REFUSED(GetDirectionalDerivative, DERIVATIVE, const double *seed, size_t n_seed, double *found, size_t n_found)
REFUSED(GetAdjointDerivative, DERIVATIVE, const double *seed, size_t n_seed, double *found, size_t n_found)
REFUSED(GetOutputDerivatives, REFERENCES, const int32_t *orders, double *values, size_t n_values)
REFUSED(ActivateModelPartition, SELF, uint32_t clock, double time)
#endif

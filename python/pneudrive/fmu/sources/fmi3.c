/* FMI 3.0 for co-simulation. A tool that links the code statically defines FMI3_FUNCTION_PREFIX. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "instance.h"

#ifdef FMI3_FUNCTION_PREFIX
#define NAME(name) PNEUDRIVE_PASTE(FMI3_FUNCTION_PREFIX, name)
#else
#define NAME(name) name
#endif

typedef unsigned reference;
enum { OK, WARNING, DISCARD, ERROR };

static int status(int is_done)
{
    return is_done ? OK : ERROR;
}

static int enter(void *own, int from, int to)
{
    instance *self = own;
    if (self->phase != from) {
        return ERROR;
    }
    self->phase = to;
    return OK;
}

PNEUDRIVE_API const char *NAME(fmi3GetVersion)(void)
{
    return "3.0";
}

PNEUDRIVE_API int NAME(fmi3SetDebugLogging)(void *own, bool on, size_t n, const char *const categories[])
{
    (void)own, (void)on, (void)n, (void)categories;
    return OK;
}

PNEUDRIVE_API void *NAME(fmi3InstantiateCoSimulation)(const char *name, const char *token, const char *resources,
                                                      bool visible, bool logging, bool event_mode, bool early_return,
                                                      const reference *intermediate, size_t n, void *environment,
                                                      const void *log, const void *update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
    (void)intermediate, (void)n, (void)environment, (void)log, (void)update;
    return pneudrive_create(token);
}

PNEUDRIVE_API void *NAME(fmi3InstantiateModelExchange)(const char *name, const char *token, const char *resources,
                                                       bool visible, bool logging, void *environment, const void *log)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    return 0;
}

PNEUDRIVE_API void NAME(fmi3FreeInstance)(void *own)
{
    if (own != 0) {
        ((instance *)own)->phase = UNUSED;
    }
}

PNEUDRIVE_API int NAME(fmi3EnterInitializationMode)(void *own, bool has_tolerance, double tolerance, double start,
                                                    bool has_stop, double stop)
{
    instance *self = own;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    self->start = start;
    self->time = start;
    return enter(own, INSTANTIATED, INITIALISING);
}

PNEUDRIVE_API int NAME(fmi3ExitInitializationMode)(void *own)
{
    return enter(own, INITIALISING, STEPPING);
}

PNEUDRIVE_API int NAME(fmi3EnterEventMode)(void *own)
{
    (void)own;
    return ERROR;
}

PNEUDRIVE_API int NAME(fmi3EnterStepMode)(void *own)
{
    (void)own;
    return ERROR;
}

PNEUDRIVE_API int NAME(fmi3Terminate)(void *own)
{
    return enter(own, STEPPING, TERMINATED);
}

PNEUDRIVE_API int NAME(fmi3Reset)(void *own)
{
    pneudrive_reset(own);
    return OK;
}

PNEUDRIVE_API int NAME(fmi3GetFloat64)(void *own, const reference *references, size_t n, double *values, size_t count)
{
    return status(n == count && pneudrive_get(own, references, n, values));
}

PNEUDRIVE_API int NAME(fmi3SetFloat64)(void *own, const reference *references, size_t n, const double *values,
                                       size_t count)
{
    return status(n == count && pneudrive_set(own, references, n, values));
}

/* All variables are of the type Float64. */
#define NO_VARIABLES(kind, type)                                                                                       \
    PNEUDRIVE_API int NAME(fmi3Get##kind)(void *own, const reference *references, size_t n, type *values, size_t count) \
    {                                                                                                                  \
        (void)own, (void)references, (void)values;                                                                     \
        return status(n == 0 && count == 0);                                                                           \
    }                                                                                                                  \
    PNEUDRIVE_API int NAME(fmi3Set##kind)(void *own, const reference *references, size_t n, const type *values,         \
                                          size_t count)                                                                \
    {                                                                                                                  \
        (void)own, (void)references, (void)values;                                                                     \
        return status(n == 0 && count == 0);                                                                           \
    }
typedef const char *text;
NO_VARIABLES(Float32, float)
NO_VARIABLES(Int8, int8_t)
NO_VARIABLES(UInt8, uint8_t)
NO_VARIABLES(Int16, int16_t)
NO_VARIABLES(UInt16, uint16_t)
NO_VARIABLES(Int32, int32_t)
NO_VARIABLES(UInt32, uint32_t)
NO_VARIABLES(Int64, int64_t)
NO_VARIABLES(UInt64, uint64_t)
NO_VARIABLES(Boolean, bool)
NO_VARIABLES(String, text)

PNEUDRIVE_API int NAME(fmi3DoStep)(void *own, double from, double by, bool no_set, bool *event, bool *terminate,
                                   bool *early, double *last)
{
    const int is_done = pneudrive_advance(own, from + by);
    (void)no_set;
    *event = false;
    *terminate = false;
    *early = false;
    *last = ((instance *)own)->time;
    return status(is_done);
}

PNEUDRIVE_API void *NAME(fmi3InstantiateScheduledExecution)(const char *name)
{
    (void)name;
    return 0;
}

/*
 * modelDescription.xml says that the instance does not offer these. A tool does not call them, but it may look for all of
 * them. Their arguments are not used.
 */
#define NOT_CALLED(name)                                                                                               \
    PNEUDRIVE_API int NAME(name)(void *own)                                                                            \
    {                                                                                                                  \
        (void)own;                                                                                                     \
        return ERROR;                                                                                                  \
    }
NOT_CALLED(fmi3ActivateModelPartition)
NOT_CALLED(fmi3CompletedIntegratorStep)
NOT_CALLED(fmi3DeserializeFMUState)
NOT_CALLED(fmi3EnterConfigurationMode)
NOT_CALLED(fmi3EnterContinuousTimeMode)
NOT_CALLED(fmi3EvaluateDiscreteStates)
NOT_CALLED(fmi3ExitConfigurationMode)
NOT_CALLED(fmi3FreeFMUState)
NOT_CALLED(fmi3GetAdjointDerivative)
NOT_CALLED(fmi3GetBinary)
NOT_CALLED(fmi3GetClock)
NOT_CALLED(fmi3GetContinuousStateDerivatives)
NOT_CALLED(fmi3GetContinuousStates)
NOT_CALLED(fmi3GetDirectionalDerivative)
NOT_CALLED(fmi3GetEventIndicators)
NOT_CALLED(fmi3GetFMUState)
NOT_CALLED(fmi3GetIntervalDecimal)
NOT_CALLED(fmi3GetIntervalFraction)
NOT_CALLED(fmi3GetNominalsOfContinuousStates)
NOT_CALLED(fmi3GetNumberOfContinuousStates)
NOT_CALLED(fmi3GetNumberOfEventIndicators)
NOT_CALLED(fmi3GetNumberOfVariableDependencies)
NOT_CALLED(fmi3GetOutputDerivatives)
NOT_CALLED(fmi3GetShiftDecimal)
NOT_CALLED(fmi3GetShiftFraction)
NOT_CALLED(fmi3GetVariableDependencies)
NOT_CALLED(fmi3SerializeFMUState)
NOT_CALLED(fmi3SerializedFMUStateSize)
NOT_CALLED(fmi3SetBinary)
NOT_CALLED(fmi3SetClock)
NOT_CALLED(fmi3SetContinuousStates)
NOT_CALLED(fmi3SetFMUState)
NOT_CALLED(fmi3SetIntervalDecimal)
NOT_CALLED(fmi3SetIntervalFraction)
NOT_CALLED(fmi3SetShiftDecimal)
NOT_CALLED(fmi3SetShiftFraction)
NOT_CALLED(fmi3SetTime)
NOT_CALLED(fmi3UpdateDiscreteStates)

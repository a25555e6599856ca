/* FMI 2.0 for co-simulation. A tool that links the code statically defines FMI2_FUNCTION_PREFIX. */
#include <stddef.h>

#include "instance.h"

#ifdef FMI2_FUNCTION_PREFIX
#define NAME(name) PNEUDRIVE_PASTE(FMI2_FUNCTION_PREFIX, name)
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

PNEUDRIVE_API const char *NAME(fmi2GetTypesPlatform)(void)
{
    return "default";
}

PNEUDRIVE_API const char *NAME(fmi2GetVersion)(void)
{
    return "2.0";
}

PNEUDRIVE_API int NAME(fmi2SetDebugLogging)(void *own, int on, size_t n, const char *const categories[])
{
    (void)own, (void)on, (void)n, (void)categories;
    return OK;
}

PNEUDRIVE_API void *NAME(fmi2Instantiate)(const char *name, int kind, const char *token, const char *resources,
                                          const void *callbacks, int visible, int logging)
{
    (void)name, (void)resources, (void)callbacks, (void)visible, (void)logging;
    return kind == 1 ? pneudrive_create(token) : 0;
}

PNEUDRIVE_API void NAME(fmi2FreeInstance)(void *own)
{
    if (own != 0) {
        ((instance *)own)->phase = UNUSED;
    }
}

PNEUDRIVE_API int NAME(fmi2SetupExperiment)(void *own, int has_tolerance, double tolerance, double start, int has_stop,
                                            double stop)
{
    instance *self = own;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    self->start = start;
    self->time = start;
    return status(self->phase == INSTANTIATED);
}

PNEUDRIVE_API int NAME(fmi2EnterInitializationMode)(void *own)
{
    return enter(own, INSTANTIATED, INITIALISING);
}

PNEUDRIVE_API int NAME(fmi2ExitInitializationMode)(void *own)
{
    return enter(own, INITIALISING, STEPPING);
}

PNEUDRIVE_API int NAME(fmi2Terminate)(void *own)
{
    return enter(own, STEPPING, TERMINATED);
}

PNEUDRIVE_API int NAME(fmi2Reset)(void *own)
{
    pneudrive_reset(own);
    return OK;
}

PNEUDRIVE_API int NAME(fmi2GetReal)(void *own, const reference *references, size_t n, double *values)
{
    return status(pneudrive_get(own, references, n, values));
}

PNEUDRIVE_API int NAME(fmi2SetReal)(void *own, const reference *references, size_t n, const double *values)
{
    return status(pneudrive_set(own, references, n, values));
}

/* All variables are real numbers. */
#define NO_VARIABLES(kind, type)                                                                                       \
    PNEUDRIVE_API int NAME(fmi2Get##kind)(void *own, const reference *references, size_t n, type *values)               \
    {                                                                                                                  \
        (void)own, (void)references, (void)values;                                                                     \
        return status(n == 0);                                                                                         \
    }                                                                                                                  \
    PNEUDRIVE_API int NAME(fmi2Set##kind)(void *own, const reference *references, size_t n, const type *values)         \
    {                                                                                                                  \
        (void)own, (void)references, (void)values;                                                                     \
        return status(n == 0);                                                                                         \
    }
typedef const char *text;
NO_VARIABLES(Integer, int)
NO_VARIABLES(Boolean, int)
NO_VARIABLES(String, text)

PNEUDRIVE_API int NAME(fmi2DoStep)(void *own, double from, double by, int no_set)
{
    (void)no_set;
    return status(pneudrive_advance(own, from + by));
}

PNEUDRIVE_API int NAME(fmi2CancelStep)(void *own)
{
    (void)own;
    return ERROR;
}

/* modelDescription.xml says that the instance does not offer these. */
#define NOT_OFFERED(name, arguments)                                                                                   \
    PNEUDRIVE_API int NAME(name) arguments                                                                             \
    {                                                                                                                  \
        (void)own, (void)a, (void)b;                                                                                   \
        return ERROR;                                                                                                  \
    }
NOT_OFFERED(fmi2GetStatus, (void *own, int a, int *b))
NOT_OFFERED(fmi2GetRealStatus, (void *own, int a, double *b))
NOT_OFFERED(fmi2GetIntegerStatus, (void *own, int a, int *b))
NOT_OFFERED(fmi2GetBooleanStatus, (void *own, int a, int *b))
NOT_OFFERED(fmi2GetStringStatus, (void *own, int a, text *b))

/* These neither: a tool does not call them, but it may look for all of them. Their arguments are not used. */
#define NOT_CALLED(name)                                                                                               \
    PNEUDRIVE_API int NAME(name)(void *own)                                                                            \
    {                                                                                                                  \
        (void)own;                                                                                                     \
        return ERROR;                                                                                                  \
    }
NOT_CALLED(fmi2GetFMUstate)
NOT_CALLED(fmi2SetFMUstate)
NOT_CALLED(fmi2FreeFMUstate)
NOT_CALLED(fmi2SerializedFMUstateSize)
NOT_CALLED(fmi2SerializeFMUstate)
NOT_CALLED(fmi2DeSerializeFMUstate)
NOT_CALLED(fmi2GetDirectionalDerivative)
NOT_CALLED(fmi2SetRealInputDerivatives)
NOT_CALLED(fmi2GetRealOutputDerivatives)

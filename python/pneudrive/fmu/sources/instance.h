/*
 * An instance of a controller: its variables and its samples. No heap, no files: instances live in a static pool.
 *
 * Value references: 0 is the time, then inputs, parameters and outputs in the order of their structures.
 */
#ifndef PNEUDRIVE_INSTANCE_H
#define PNEUDRIVE_INSTANCE_H

#include <stddef.h>

#include "variables.h"

#ifndef PNEUDRIVE_INSTANCES
#define PNEUDRIVE_INSTANCES 8
#endif

#if defined(_WIN32)
#define PNEUDRIVE_API __declspec(dllexport)
#else
#define PNEUDRIVE_API
#endif
#define PNEUDRIVE_PASTE_(a, b) a##b
#define PNEUDRIVE_PASTE(a, b) PNEUDRIVE_PASTE_(a, b)

enum { UNUSED, INSTANTIATED, INITIALISING, STEPPING, TERMINATED };

typedef struct {
    int phase;
    double start;
    double time;
    double tick;
    model_input in;
    model_parameters parameters;
    model_output out;
    model_memory memory;
} instance;

/* The structures hold doubles only. */
typedef char pneudrive_input_size[sizeof(model_input) == MODEL_INPUTS * sizeof(double) ? 1 : -1];
typedef char pneudrive_parameter_size[sizeof(model_parameters) == MODEL_PARAMETERS * sizeof(double) ? 1 : -1];
typedef char pneudrive_output_size[sizeof(model_output) == MODEL_OUTPUTS * sizeof(double) ? 1 : -1];

static instance pneudrive_pool[PNEUDRIVE_INSTANCES];

static int pneudrive_is_token(const char *token)
{
    static const char own[] = MODEL_TOKEN;
    unsigned i;
    for (i = 0; i < sizeof own; i++) {
        if (token == 0 || token[i] != own[i]) {
            return 0;
        }
    }
    return 1;
}

static void pneudrive_reset(instance *own)
{
    static const model_input no_input;
    static const model_output no_output;
    static const model_memory no_memory;
    own->phase = INSTANTIATED;
    own->start = 0.0;
    own->time = 0.0;
    own->tick = 0.0;
    own->in = no_input;
    own->parameters = MODEL_TUNED;
    own->out = no_output;
    own->memory = no_memory;
}

static instance *pneudrive_create(const char *token)
{
    unsigned i;
    for (i = 0; pneudrive_is_token(token) && i < PNEUDRIVE_INSTANCES; i++) {
        if (pneudrive_pool[i].phase == UNUSED) {
            pneudrive_reset(&pneudrive_pool[i]);
            return &pneudrive_pool[i];
        }
    }
    return 0;
}

/* The place of a variable, or no place. */
static double *pneudrive_variable(instance *own, unsigned reference)
{
    if (reference == 0) {
        return &own->time;
    }
    if (reference <= MODEL_INPUTS) {
        return (double *)&own->in + (reference - 1);
    }
    if (reference <= MODEL_INPUTS + MODEL_PARAMETERS) {
        return (double *)&own->parameters + (reference - 1 - MODEL_INPUTS);
    }
    if (reference <= MODEL_INPUTS + MODEL_PARAMETERS + MODEL_OUTPUTS) {
        return (double *)&own->out + (reference - 1 - MODEL_INPUTS - MODEL_PARAMETERS);
    }
    return 0;
}

/* Parameters keep their values during a run. */
static int pneudrive_may_set(const instance *own, unsigned reference)
{
    const int is_input = 1 <= reference && reference <= MODEL_INPUTS;
    const int is_parameter = MODEL_INPUTS < reference && reference <= MODEL_INPUTS + MODEL_PARAMETERS;
    const int is_early = own->phase == INSTANTIATED || own->phase == INITIALISING;
    return is_early ? is_input || is_parameter : is_input && own->phase == STEPPING;
}

static int pneudrive_set(instance *own, const unsigned *references, size_t n, const double *values)
{
    size_t i;
    for (i = 0; i < n; i++) {
        if (!pneudrive_may_set(own, references[i])) {
            return 0;
        }
        *pneudrive_variable(own, references[i]) = values[i];
    }
    return 1;
}

static int pneudrive_get(instance *own, const unsigned *references, size_t n, double *values)
{
    size_t i;
    for (i = 0; i < n; i++) {
        const double *place = pneudrive_variable(own, references[i]);
        if (place == 0) {
            return 0;
        }
        values[i] = *place;
    }
    return 1;
}

/* All samples before a time take the present inputs. */
static int pneudrive_advance(instance *own, double until)
{
    const double size = until < 0.0 ? -until : until;
    const double same = 1e-9 * (size > 1.0 ? size : 1.0);
    if (own->phase != STEPPING) {
        return 0;
    }
    while (own->start + own->tick * MODEL_PERIOD < until - same) {
        MODEL_STEP(&own->parameters, &own->memory, &own->in, &own->out);
        own->tick += 1.0;
    }
    own->time = until;
    return 1;
}

#endif

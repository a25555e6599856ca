#include "@name@.h"
#include "pneudrive_math.h"

const @name@_parameters @name@_tuned = { @values@ };

typedef struct {
    @name@_input in;
    double opens;
    double begins;
} @name@_checked;

static void check(const @name@_input *in, const @name@_parameters *parameters, const double *before, @name@_checked *checked, double *guard, @name@_output *out)
{
@check@}

static void begin(const @name@_input *in, const @name@_parameters *parameters, const double *kept, double *seen)
{
    (void)kept; /* unused without adaptation */
@begin@}

static void observe(const @name@_input *in, const @name@_parameters *parameters, const double *kept, double *seen)
{
@observe@}

static void command(const @name@_input *in, const @name@_parameters *parameters, const double *seen, double *kept, @name@_output *out)
{
@command@}

void @name@_step(const @name@_parameters *parameters, @name@_memory *memory, const @name@_input *in, @name@_output *out)
{
    @name@_checked checked;
    double before[@checks@];
    double seen[@seen@];
    int i;

    for (i = 0; i < @checks@; i++) {
        before[i] = memory->guard[i];
    }
    check(in, parameters, before, &checked, memory->guard, out);
    if (0.5 < checked.opens) {
        if (0.5 < checked.begins) {
            begin(&checked.in, parameters, memory->kept, seen);
        } else {
            observe(&checked.in, parameters, memory->kept, seen);
        }
        command(&checked.in, parameters, seen, memory->kept, out);
    } else {
@rests@    }
    memory->guard[@last_check@] = out->velocity;
}

void @name@_move(double start, double target, double begin_time, double duration, double at_time, double wanted[4])
{
@move@}

#include "@name@.h"
#include "pneudrive_math.h"

const @name@_parameters @name@_tuned = { @values@ };

typedef struct {
    @name@_input in;
    @real@ opens;
    @real@ begins;
} @name@_checked;

static void check(const @name@_input *in, const @name@_parameters *parameters, const @real@ *before, @name@_checked *checked, @real@ *guard, @name@_output *out)
{
@check@}

static void begin(const @name@_input *in, const @name@_parameters *parameters, const @real@ *kept, @real@ *seen)
{
    (void)kept; /* unused without adaptation */
@begin@}

static void observe(const @name@_input *in, const @name@_parameters *parameters, const @real@ *kept, @real@ *seen)
{
@observe@}

static void command(const @name@_input *in, const @name@_parameters *parameters, const @real@ *seen, @real@ *kept, @name@_output *out)
{
@command@}

void @name@_step(const @name@_parameters *parameters, @name@_memory *memory, const @name@_input *in, @name@_output *out)
{
    @name@_checked checked;
    @real@ before[@checks@];
    @real@ seen[@seen@];
    int i;

    for (i = 0; i < @checks@; i++) {
        before[i] = memory->guard[i];
    }
    check(in, parameters, before, &checked, memory->guard, out);
    if (0 < checked.opens) {
        if (0 < checked.begins) {
            begin(&checked.in, parameters, memory->kept, seen);
        } else {
            observe(&checked.in, parameters, memory->kept, seen);
        }
        command(&checked.in, parameters, seen, memory->kept, out);
    } else {
@rests@    }
    memory->guard[@last_check@] = out->velocity;
}

void @name@_move(@real@ start, @real@ target, @real@ begin_time, @real@ duration, @real@ at_time, @real@ wanted[4])
{
@move@}

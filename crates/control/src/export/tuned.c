/*
@about@ */
#include "@name@.h"

const @name@_parameters @name@_tuned = { @values@{ @numbers@} };

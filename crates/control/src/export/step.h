/*
@about@ */
#ifndef @NAME@_H
#define @NAME@_H

/* Inputs of a sample. */
typedef struct {
@inputs@} @name@_input;

typedef struct {
@outputs@    @real@ status;  /* -: see above */
} @name@_output;

typedef struct {
@parameters@} @name@_parameters;

/* State: all zero before the first sample. */
typedef struct {
    @real@ guard[@checks@];
    @real@ kept[@kept@];
} @name@_memory;

/* Parameters that follow from the description of the drive. */
extern const @name@_parameters @name@_tuned;

void @name@_step(const @name@_parameters *parameters, @name@_memory *memory, const @name@_input *in, @name@_output *out);

/* A reference: position, velocity, acceleration and jerk of a move at a time. It rests before and after. */
void @name@_move(@real@ start, @real@ target, @real@ begin_time, @real@ duration, @real@ at_time, @real@ wanted[4]);

#endif

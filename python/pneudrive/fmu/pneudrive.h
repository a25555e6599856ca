/* A pneumatic drive in a C program.

   All values are in SI, pressures absolute. Positions and velocities grow towards the end of chamber b. Functions that
   return an int return 0 for success; otherwise pneudrive_message says what was wrong, and the drive stays as it was. After
   a step that failed, a drive can only be restored or freed.
   Drives are independent of each other; one drive belongs to one thread at a time.

       cc program.c -L. -lpneudrive -Wl,-rpath,'$ORIGIN' -o program
*/
#ifndef PNEUDRIVE_H
#define PNEUDRIVE_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct pneudrive pneudrive;

/* A drive at its start, from the text of drive.json. NULL where that fails; then `message`, which has room for `size`
   characters, or is NULL, says why. Parameters and the start can be set until the first step. */
pneudrive *pneudrive_create(const char *json, char *message, size_t size);
void pneudrive_free(pneudrive *drive);

/* Command of the valve, -1 to 1, and external force in +x, N, from now on. A command before the first step has acted for
   long by then. */
int pneudrive_command(pneudrive *drive, double command);
int pneudrive_force(pneudrive *drive, double force_n);

/* Any input, and before the first step any parameter, by its name in drive.json: "left.command", "friction.coulomb",
   "start.position". */
int pneudrive_set(pneudrive *drive, const char *name, double value);

/* Goes on by a time, s. */
int pneudrive_step(pneudrive *drive, double by_s);

/* Any variable by its name: "time", "position", "pressure_a", "mass_a", "der(velocity)". */
int pneudrive_read(pneudrive *drive, const char *name, double *value);

/* The whole drive as bytes, from which a drive of the same drive.json and version goes on with the same bits. */
int pneudrive_saved_size(pneudrive *drive, size_t *size);
int pneudrive_save(pneudrive *drive, unsigned char *bytes, size_t size);
int pneudrive_restore(pneudrive *drive, const unsigned char *bytes, size_t size);

/* What was wrong last; it lives until the next call with this drive. */
const char *pneudrive_message(pneudrive *drive);

const char *pneudrive_version(void);

#ifdef __cplusplus
}
#endif

#endif

/* A pneumatic drive in a C program.

   All values are in SI, pressures absolute. Positions and velocities grow towards the end of chamber b. Functions that
   return an int return 0 for success; otherwise pneudrive_message returns the reason, and the drive is unchanged. After
   a failed step, a drive can only be restored or freed.
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

/* Creates a drive at its start from the text of drive.json, or returns NULL and writes the reason into `message`, which
   has room for `size` characters or is NULL. Parameters and the start can be set until the first step. */
pneudrive *pneudrive_create(const char *json, char *message, size_t size);
void pneudrive_free(pneudrive *drive);

/* Set the command of the valve (-1 to 1), and the external force in +x in N. The valve has already settled at a command
   that is given before the first step. */
int pneudrive_command(pneudrive *drive, double command);
int pneudrive_force(pneudrive *drive, double force_n);

/* Sets any input, and before the first step any parameter, by its name in drive.json: "left.command",
   "friction.coulomb", "start.position". */
int pneudrive_set(pneudrive *drive, const char *name, double value);

/* Advances the drive by a time in s. */
int pneudrive_step(pneudrive *drive, double by_s);

/* Reads any variable by its name: "time", "position", "pressure_a", "mass_a", "der(velocity)". */
int pneudrive_read(pneudrive *drive, const char *name, double *value);

/* Save and restore the state of a drive as bytes. A drive with the same drive.json and version then continues with
   identical results. */
int pneudrive_saved_size(pneudrive *drive, size_t *size);
int pneudrive_save(pneudrive *drive, unsigned char *bytes, size_t size);
int pneudrive_restore(pneudrive *drive, const unsigned char *bytes, size_t size);

/* Returns the message of the last error. It is valid until the next call with this drive. */
const char *pneudrive_message(pneudrive *drive);

const char *pneudrive_version(void);

#ifdef __cplusplus
}
#endif

#endif

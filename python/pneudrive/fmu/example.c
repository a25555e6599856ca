/* Moves the drive of drive.json, beside this program, for 0.1 s, and prints time, position and pressures.

       cc example.c -L. -lpneudrive -Wl,-rpath,'$ORIGIN' -o example && ./example drive.json
*/
#include "pneudrive.h"

#include <stdio.h>
#include <stdlib.h>

/* The text of a file, or NULL. */
static char *read_text(const char *path)
{
    FILE *file = fopen(path, "rb");
    char *text = NULL;
    long size;
    if (file == NULL)
        return NULL;
    if (fseek(file, 0, SEEK_END) == 0 && (size = ftell(file)) >= 0 && fseek(file, 0, SEEK_SET) == 0) {
        text = malloc((size_t)size + 1);
        if (text != NULL)
            text[fread(text, 1, (size_t)size, file)] = '\0';
    }
    fclose(file);
    return text;
}

/* Ends the program if a call has failed. */
static void check(pneudrive *drive, int failed)
{
    if (failed) {
        fprintf(stderr, "%s\n", pneudrive_message(drive));
        pneudrive_free(drive);
        exit(1);
    }
}

int main(int count, char **words)
{
    char message[1000];
    char *json = read_text(count > 1 ? words[1] : "drive.json");
    pneudrive *drive;
    int k;
    if (json == NULL) {
        fprintf(stderr, "there is no drive.json\n");
        return 1;
    }
    drive = pneudrive_create(json, message, sizeof message);
    free(json);
    if (drive == NULL) {
        fprintf(stderr, "%s\n", message);
        return 1;
    }
    for (k = 0; k <= 100; k++) {
        double t, x, a, b;
        check(drive, pneudrive_read(drive, "time", &t));
        check(drive, pneudrive_read(drive, "position", &x));
        check(drive, pneudrive_read(drive, "pressure_a", &a));
        check(drive, pneudrive_read(drive, "pressure_b", &b));
        printf("%.3f s  %.17g m  %.0f Pa  %.0f Pa\n", t, x, a, b);
        check(drive, pneudrive_command(drive, k < 50 ? 0.6 : -0.4));
        check(drive, pneudrive_step(drive, 1e-3));
    }
    pneudrive_free(drive);
    return 0;
}

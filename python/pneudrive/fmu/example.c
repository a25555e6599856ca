/* Moves the drive of drive.json, beside this program, for 0.1 s, and prints some of its variables.

       cc example.c -L. -lpneudrive -Wl,-rpath,'$ORIGIN' -o example && ./example drive.json
*/
#include "pneudrive.h"

#include <stdio.h>
#include <stdlib.h>

/* The inputs that get the command, and the printed variables, by their names in drive.json. */
static const char *const COMMANDS[] = {"command", NULL};
static const char *const SHOWN[] = {"position", "pressure_a", "pressure_b", NULL};

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
    const char *const *name;
    double value;
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
        check(drive, pneudrive_read(drive, "time", &value));
        printf("time %.3f s", value);
        for (name = SHOWN; *name != NULL; name++) {
            check(drive, pneudrive_read(drive, *name, &value));
            printf("  %s %.17g", *name, value);
        }
        printf("\n");
        for (name = COMMANDS; *name != NULL; name++)
            check(drive, pneudrive_set(drive, *name, k < 50 ? 1.0 : 0.0));
        check(drive, pneudrive_step(drive, 1e-3));
    }
    pneudrive_free(drive);
    return 0;
}

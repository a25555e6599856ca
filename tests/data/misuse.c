
#include "pneudrive.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#define TELL(call) do { int failed = (call); printf("%d %s\n", failed, pneudrive_message(drive)); } while (0)
int main(int count, char **words)
{
    char message[40], text[200000];
    size_t size, n;
    unsigned char *bytes;
    double x, again;
    pneudrive *drive;
    FILE *file = fopen(words[count - 1], "rb");
    text[fread(text, 1, sizeof text - 1, file)] = 0;
    fclose(file);
    x = pneudrive_create("{", message, sizeof message) == NULL;
    printf("%.0f %s\n", x, message);
    printf("%d\n", pneudrive_create(NULL, NULL, 0) == NULL);
    drive = pneudrive_create(text, message, sizeof message);
    TELL(pneudrive_command(drive, 1.5) || pneudrive_step(drive, 1e-3));
    TELL(pneudrive_set(drive, "friction.colomb", 1.0));
    printf("%d\n", pneudrive_set(drive, "friction.coulomb", 40.0) || pneudrive_command(drive, 0.6));
    printf("%d\n", pneudrive_force(drive, -20.0) || pneudrive_step(drive, 0.05));
    TELL(pneudrive_set(drive, "friction.coulomb", 30.0));
    printf("%d\n", pneudrive_saved_size(drive, &size));
    bytes = malloc(size);
    printf("%d\n", pneudrive_save(drive, bytes, size));
    for (n = 0; n < 2; n++) {
        printf("%d\n", pneudrive_restore(drive, bytes, size) || pneudrive_step(drive, 0.02));
        pneudrive_read(drive, "position", n ? &again : &x);
    }
    printf("%d %.17g\n", memcmp(&x, &again, sizeof x), x);
    TELL(pneudrive_restore(drive, bytes, size - 1));
    printf("%d %s\n", pneudrive_read(NULL, "time", &x), pneudrive_message(NULL));
    free(bytes);
    pneudrive_free(drive);
    pneudrive_free(NULL);
    return 0;
}

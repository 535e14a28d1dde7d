/* What the C programs of this repository check with. */
#ifndef VISAVIS_CHECK_H
#define VISAVIS_CHECK_H
#include "visavis.h"
#include <stdio.h>
#include <stdlib.h>

#define CHECK(condition)                                                                                              \
    do {                                                                                                              \
        if (!(condition)) {                                                                                           \
            fprintf(stderr, "%s:%d: %s (last error: %s)\n", __FILE__, __LINE__, #condition, visavis_last_error());     \
            exit(1);                                                                                                  \
        }                                                                                                             \
    } while (0)
#define OK(call) CHECK((call) == VISAVIS_STATUS_OK)
#define REFUSED(status, call) CHECK((call) == VISAVIS_STATUS_##status && visavis_last_error()[0] != '\0')

#endif

/* Number type of code that FMUs and bare C libraries share. A bare library redefines it. */
#ifndef MBS_REAL_H
#define MBS_REAL_H

#include <math.h>

typedef double real;
#define REAL(number) number
#define SHARED
#define real_abs fabs
#define real_within_half_turn(angle) atan2(sin(angle), cos(angle))
#define real_max fmax
#define real_min fmin
#define real_finite isfinite

#endif

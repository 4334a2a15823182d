/* A sensor's samples onto the base clock's even grid: each value is the sensor's mean since the
 * grid time before.
 *
 * The mean is exact for rates that are constant between the sensor's own samples, so that the angle
 * is kept whatever the two rates are; a raw count stays linear in what the sensor measured, so that
 * y = M (x - bias) holds after it as before.
 */
#ifndef HS_RESAMPLER_H
#define HS_RESAMPLER_H

#include "core/limits.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct hs_grid { /* times 1/rate apart, the fraction of a ns carried on */
    uint64_t t;  /* ns */
    uint32_t fraction, index;
    uint32_t period, period_fraction; /* ns, 2^-32 ns */
};

struct hs_resampler {
    struct hs_grid grid; /* next grid time to complete */
    uint64_t start;      /* where its interval begins */
    uint64_t newest;     /* time of the newest reading; 0: none */
    uint64_t gap;        /* ns without a reading that are missing samples */
    int64_t sum[HS_AXES];
    uint64_t covered;          /* ns of the interval that readings cover */
    int16_t at_limit[HS_AXES]; /* the reading at the sensor's limit, 0: none */
    int16_t limit[HS_AXES];
    uint8_t axes;
    uint32_t index_of[HS_RING];
    int16_t value[HS_RING][HS_AXES];
    bool running;
};

struct hs_grid hs_grid_at(uint64_t t, double rate); /* rate: 1 to 10000 Hz */
void hs_grid_step(struct hs_grid *grid);

/* Begin at `grid`, whose first interval begins a period before its time. */
void hs_resampler_start(struct hs_resampler *r, struct hs_grid grid);

/* A reading that is the mean since the reading before. */
void hs_resampler_push(struct hs_resampler *r, uint64_t t, const int16_t *value);

/* The sample of this index, or NULL where it was not measured. */
const int16_t *hs_resampler_at(const struct hs_resampler *r, uint32_t index);

#endif

/* A sensor's own clock against the base clock: a line through pairs of both, read together. */
#ifndef HS_SENSOR_CLOCK_H
#define HS_SENSOR_CLOCK_H

#include "core/limits.h"

#include <stdbool.h>
#include <stdint.h>

#define HS_ANCHORS 16 /* pairs that are kept, half a second and more from each other */

struct hs_sensor_clock {
    uint64_t ticks;  /* newest of the sensor's clock, whole */
    uint64_t base;   /* ns of the base clock at `ticks`, smoothed */
    uint64_t period; /* ns a tick, times 2^32 */
    uint64_t anchor_ticks[HS_ANCHORS], anchor_base[HS_ANCHORS];
    uint32_t anchors; /* so many were taken */
    uint32_t pairs;
};

void hs_sensor_clock_start(struct hs_sensor_clock *clock, uint32_t nominal_tick);

/* A pair: the sensor's counter, its lowest `bits`, read between the base times `before` and
 * `after`. */
void hs_sensor_clock_pair(struct hs_sensor_clock *clock, uint32_t counter, uint8_t bits,
                          uint64_t before, uint64_t after);

/* Base time of a stamp of `bits` that lies less than half its span from the newest pair. */
uint64_t hs_sensor_clock_time(const struct hs_sensor_clock *clock, uint32_t stamp, uint8_t bits);

#endif

#include "core/sensor_clock.h"

#define ANCHOR_EVERY (HS_SECOND / 2)
#define LEAST_BASELINE (HS_SECOND / 10) /* a shorter one tells less than the data sheet */
#define SMOOTHING 8                     /* pairs over which a pair's own error is averaged */
#define UNLEARNT                                                                                   \
    100000 /* ns: a larger error is a rate that is not known yet, and is not averaged */
#define SLOW_TRANSFER 200000       /* ns: somebody interrupted the reading, the pair says little */
#define STEP (10 * HS_MILLISECOND) /* an error this large is a clock that was set anew */

void hs_sensor_clock_start(struct hs_sensor_clock *clock, uint32_t nominal_tick)
{
    *clock = (struct hs_sensor_clock){.period = (uint64_t)nominal_tick << 32};
}

/* Signed difference of counters of `bits`. */
static int64_t difference(uint32_t a, uint64_t b, uint8_t bits)
{
    const uint8_t above = (uint8_t)(32 - bits);
    return (int32_t)((a - (uint32_t)b) << above) >> above;
}

/* ns of `ticks` that may be negative and span seconds: high and low part apart, so that nothing
 * overflows. */
static int64_t span(const struct hs_sensor_clock *clock, int64_t ticks)
{
    const int64_t whole = (int64_t)(clock->period >> 32),
                  part = (int64_t)(clock->period & 0xffffffffu);
    return ticks * whole + ((ticks * (part >> 8)) >> 24);
}

static void take_anchor(struct hs_sensor_clock *clock, uint64_t ticks, uint64_t base)
{
    const uint32_t newest = (clock->anchors - 1) % HS_ANCHORS;
    if (clock->anchors == 0 || base - clock->anchor_base[newest] >= ANCHOR_EVERY) {
        clock->anchor_ticks[clock->anchors % HS_ANCHORS] = ticks;
        clock->anchor_base[clock->anchors % HS_ANCHORS] = base;
        clock->anchors++;
    }
}

static void measure_period(struct hs_sensor_clock *clock, uint64_t ticks, uint64_t base)
{
    const uint32_t oldest = clock->anchors > HS_ANCHORS ? clock->anchors % HS_ANCHORS : 0;
    const uint64_t elapsed = base - clock->anchor_base[oldest],
                   counted = ticks - clock->anchor_ticks[oldest];
    if (elapsed >= LEAST_BASELINE && counted > 0) {
        const uint64_t whole = elapsed / counted,
                       rest = elapsed % counted; /* both below 2^32: seconds and their ticks */
        clock->period = whole << 32 | (rest << 32) / counted;
    }
}

void hs_sensor_clock_pair(struct hs_sensor_clock *clock, uint32_t counter, uint8_t bits,
                          uint64_t before, uint64_t after)
{
    const uint64_t base = before + (after - before) / 2;
    if (clock->pairs == 0) {
        clock->ticks = counter;
        clock->base = base;
        clock->pairs = 1;
        take_anchor(clock, clock->ticks, base);
        return;
    }
    const int64_t ahead = difference(counter, clock->ticks, bits);
    const uint64_t expected = clock->base + (uint64_t)span(clock, ahead);
    int64_t error = (int64_t)(base - expected);
    if (after - before > SLOW_TRANSFER) {
        return;
    }
    if (ahead < 0 || error > (int64_t)STEP || error < -(int64_t)STEP) {
        const uint64_t period = clock->period;
        hs_sensor_clock_start(clock, 0);
        clock->period = period;
        hs_sensor_clock_pair(clock, counter, bits, before, after);
        return;
    }
    clock->ticks += (uint64_t)ahead;
    clock->pairs = error > (int64_t)UNLEARNT || error < -(int64_t)UNLEARNT ? 1 : clock->pairs + 1;
    clock->base = expected + (uint64_t)(error / (clock->pairs < SMOOTHING ? (int64_t)clock->pairs
                                                                          : SMOOTHING));
    measure_period(clock, clock->ticks, base);
    take_anchor(clock, clock->ticks, base);
}

uint64_t hs_sensor_clock_time(const struct hs_sensor_clock *clock, uint32_t stamp, uint8_t bits)
{
    return clock->base + (uint64_t)span(clock, difference(stamp, clock->ticks, bits));
}

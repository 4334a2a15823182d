#include "core/sensor.h"

#include "core/messages.h"

#define TEST_READS 8                     /* averaged, with and without the excitation */
#define TEST_PAUSE (60 * HS_MILLISECOND) /* a sensor settles after a change of its excitation */
#define READ_PAUSE (5 * HS_MILLISECOND)
#define SYNC_EVERY (50 * HS_MILLISECOND)
#define SILENCE (60 * HS_MILLISECOND) /* without a reading a sensor is asked who it is */
#define MOST_FAULTS 3
#define LOOK_AGAIN (250 * HS_MILLISECOND)
#define DRAINED 32    /* readings at once */
#define GAP_PERIODS 3 /* of the sensor's own samples */

static void be_absent(struct hs_sensor *s)
{
    s->phase = HS_ABSENT;
    s->due = board_now() + LOOK_AGAIN;
}

static void enter(struct hs_sensor *s, enum hs_phase phase, uint64_t wait)
{
    s->phase = phase;
    s->due = board_now() + wait;
    s->reads = 0;
    for (int k = 0; k < HS_AXES; k++) {
        s->sum[k] = 0;
    }
}

bool hs_sensor_begin(struct hs_sensor *s)
{
    s->resampler.newest = 0;
    if (!s->driver->probe(&s->bus) || !s->driver->reset(&s->bus)) {
        be_absent(s);
        return false;
    }
    enter(s, HS_RESET, (uint64_t)s->driver->start_ms * HS_MILLISECOND);
    return true;
}

void hs_sensor_configure(struct hs_sensor *s)
{
    if (!s->driver->configure(&s->bus, &s->setting)) {
        be_absent(s);
        return;
    }
    s->partial = (struct hs_partial){0};
    s->faults = 0;
    s->readings = 0;
    s->resampler.gap =
        s->driver->has_clock ? (uint64_t)(GAP_PERIODS * 1e9f / s->setting.hz) : HS_SECOND / 4;
    s->resampler.axes = s->driver->axes;
    for (int k = 0; k < s->driver->axes; k++) {
        const float counts = s->setting.full_scale[k / 3] / s->setting.scale[k / 3];
        s->resampler.limit[k] = (int16_t)(counts < 32767.0f ? counts : 32767.0f);
    }
    enter(s, HS_SETTLING, (uint64_t)s->driver->settle_ms * HS_MILLISECOND);
}

/* Ranges of the self-test's limits, fast enough for its reads. */
static void configure_for_test(struct hs_sensor *s)
{
    static const float widest[2] = {2000 * HS_DEGREE, 16 * HS_STANDARD_GRAVITY};
    const struct hs_setting wanted = s->setting;
    if (s->driver->choose(400, widest, &s->setting) && s->driver->configure(&s->bus, &s->setting) &&
        s->driver->excite(&s->bus, false)) {
        enter(s, HS_QUIET, TEST_PAUSE);
    } else {
        be_absent(s);
    }
    s->setting = wanted;
}

static void judge_test(struct hs_sensor *s)
{
    s->tested = s->passed = true;
    for (int k = 0; k < s->driver->axes; k++) {
        const int32_t moved = (s->sum[k] - s->quiet[k]) / TEST_READS,
                      size = moved < 0 ? -moved : moved;
        s->passed =
            s->passed && size >= s->driver->test_least[k] && size <= s->driver->test_most[k];
    }
}

static void read_for_test(struct hs_sensor *s)
{
    int16_t value[HS_AXES];
    if (!s->driver->read_now(&s->bus, value)) {
        be_absent(s);
        return;
    }
    for (int k = 0; k < s->driver->axes; k++) {
        s->sum[k] += value[k];
    }
    s->due = board_now() + READ_PAUSE;
    if (++s->reads < TEST_READS) {
        return;
    }
    if (s->phase == HS_QUIET) {
        memcpy(s->quiet, s->sum, sizeof s->quiet);
        s->driver->excite(&s->bus, true);
        enter(s, HS_EXCITED, TEST_PAUSE);
    } else {
        judge_test(s);
        s->driver->excite(&s->bus, false);
        hs_sensor_configure(s);
    }
}

static void synchronize(struct hs_sensor *s)
{
    uint32_t ticks = 0;
    if (!s->driver->has_clock || board_now() < s->next_sync) {
        return;
    }
    const uint64_t before = board_now();
    if (s->driver->sync(&s->bus, &ticks)) {
        hs_sensor_clock_pair(&s->clock, ticks, s->driver->sync_bits, before, board_now());
    }
    s->next_sync = before + (s->clock.pairs < 8 ? SYNC_EVERY / 8 : SYNC_EVERY);
}

static void take_readings(struct hs_sensor *s, const struct hs_reading *readings, int n)
{
    const uint64_t now = board_now();
    for (int k = 0; k < n; k++) {
        const uint64_t t = s->driver->has_clock ? hs_sensor_clock_time(&s->clock, readings[k].ticks,
                                                                       s->driver->stamp_bits)
                                                : now;
        hs_resampler_push(&s->resampler, t, readings[k].value);
    }
    s->readings += (uint32_t)n;
    s->last_reading = n > 0 ? now : s->last_reading;
}

static void run(struct hs_sensor *s)
{
    static struct hs_reading readings[DRAINED];
    synchronize(s);
    int n;
    do {
        n = s->driver->drain(&s->bus, &s->partial, readings, DRAINED);
        if (n > 0) {
            take_readings(s, readings, n);
        }
    } while (n == DRAINED);
    s->faults = n < 0 ? (uint8_t)(s->faults + 1) : 0;
    const bool silent = board_now() - s->last_reading > SILENCE + (uint64_t)(4e9f / s->setting.hz);
    if (s->faults >= MOST_FAULTS || (silent && !s->driver->probe(&s->bus))) {
        be_absent(s);
    } else if (silent) {
        hs_sensor_configure(
            s); /* it answers and gives nothing: its supply may have failed for a moment */
    }
}

bool hs_sensor_advance(struct hs_sensor *s)
{
    const bool due = board_now() >= s->due;
    switch (s->phase) {
    case HS_ABSENT: return due ? hs_sensor_begin(s) : false;
    case HS_RESET:
        if (due && s->driver->excite != NULL && !s->tested) {
            configure_for_test(s);
        } else if (due) {
            hs_sensor_configure(s);
        }
        break;
    case HS_QUIET:
    case HS_EXCITED:
        if (due) {
            read_for_test(s);
        }
        break;
    case HS_SETTLING:
        if (due) {
            static struct hs_reading unsettled[DRAINED];
            while (s->driver->drain(&s->bus, &s->partial, unsettled, DRAINED) == DRAINED) {
            }
            hs_sensor_clock_start(&s->clock, s->driver->tick);
            s->phase = HS_RUNNING;
            s->last_reading = board_now();
            s->next_sync = 0;
        }
        break;
    case HS_RUNNING: run(s); break;
    }
    return s->phase != HS_ABSENT;
}

float hs_sensor_true_rate(const struct hs_sensor *s)
{
    if (!s->driver->has_clock || s->clock.anchors < 2) {
        return s->setting.hz;
    }
    const float tick = (float)((double)s->clock.period / 4294967296.0);
    return s->setting.hz * (float)s->driver->tick / tick;
}

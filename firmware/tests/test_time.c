/* Sensors' clocks against the base clock, and samples onto the common grid. */
#include "tests/bench.h"

#include <math.h>

static void test_a_grid_does_not_drift(void)
{
    static const double rates[] = {1, 50, 100, 119.7, 200, 333.3, 1000};
    for (size_t r = 0; r < sizeof rates / sizeof rates[0]; r++) {
        struct hs_grid grid = hs_grid_at(HS_SECOND, rates[r]);
        for (uint32_t k = 0; k < 2000000; k++) {
            hs_grid_step(&grid);
        }
        const double expected = 1e9 + 2000000 * (1e9 / rates[r]);
        CHECK(fabs((double)grid.t - expected) < 2.0 + 2000000.0 / 4294967296.0);
        CHECK(grid.index == 2000000);
    }
}

static void test_a_clock_is_measured_to_some_ppm_in_eight_seconds(void)
{
    for (int ppm = -20000; ppm <= 20000; ppm += 8000) {
        struct hs_sensor_clock clock;
        hs_sensor_clock_start(&clock, 16000);
        double worst = 0;
        sim.random = 5;
        for (uint64_t t = HS_SECOND; t < 11ull * HS_SECOND; t += 50 * HS_MILLISECOND) {
            const double ticks = (double)t * (1 + ppm * 1e-6) / 16000;
            const uint64_t delay = 20000 + sim_draw() % 40000; /* ns that the reading takes */
            hs_sensor_clock_pair(&clock, (uint32_t)ticks & 0xFFFFF, 20, t - delay / 2,
                                 t + delay / 2);
            const uint64_t sample = t - 7 * HS_MILLISECOND;
            const double stamp = floor((double)sample * (1 + ppm * 1e-6) / 16000);
            const double error =
                (double)(int64_t)(hs_sensor_clock_time(&clock, (uint32_t)(uint64_t)stamp & 0xFFFF,
                                                       16) -
                                  sample);
            worst = t > 1300ull * HS_MILLISECOND && fabs(error) > worst ? fabs(error) : worst;
        }
        const double period = (double)clock.period / 4294967296.0;
        CHECK(fabs(period * (1 + ppm * 1e-6) / 16000 - 1) < 5e-6);
        CHECK(worst < 33000); /* ns: two ticks */
    }
}

static void test_a_counter_that_was_set_anew_is_followed(void)
{
    struct hs_sensor_clock clock;
    hs_sensor_clock_start(&clock, 16000);
    hs_sensor_clock_pair(&clock, 1000, 20, HS_SECOND, HS_SECOND);
    hs_sensor_clock_pair(&clock, 5, 20, 2ull * HS_SECOND, 2ull * HS_SECOND);
    CHECK(hs_sensor_clock_time(&clock, 5, 16) == 2ull * HS_SECOND);
}

static void start(struct hs_resampler *r, double rate, uint64_t t)
{
    memset(r, 0, sizeof *r);
    r->axes = 6;
    r->gap = 6 * HS_MILLISECOND;
    for (int k = 0; k < 6; k++) {
        r->limit[k] = 28571;
    }
    hs_resampler_start(r, hs_grid_at(t, rate));
}

/* Readings at 1.013 x 500 Hz; the sum of what comes out is the integral of what went in. */
static void test_the_angle_is_kept(void)
{
    struct hs_resampler r;
    double out = 0;
    uint64_t t = HS_SECOND - 8 * HS_MILLISECOND;
    start(&r, 200, HS_SECOND);
    uint32_t next = 0;
    double in = 0;
    for (int k = 0; k < 10000; k++) {
        const int16_t value[6] = {(int16_t)(20000 * sin(k * 0.05)), 100, -100, 1, 0, -1};
        const uint64_t before = t;
        t += 1974333;
        hs_resampler_push(&r, t, value);
        const uint64_t from =
            before > HS_SECOND - 5 * HS_MILLISECOND ? before : HS_SECOND - 5 * HS_MILLISECOND;
        const uint64_t to = t < HS_SECOND + 19ull * HS_SECOND ? t : HS_SECOND + 19ull * HS_SECOND;
        in += k > 0 && to > from ? value[0] * (double)(to - from) * 1e-9 : 0;
        for (; next < r.grid.index; next++) {
            const int16_t *sample = hs_resampler_at(&r, next);
            CHECK(sample != NULL && sample[1] == 100 && sample[2] == -100 && sample[3] == 1 &&
                  sample[5] == -1);
            out += next <= 3800 ? sample[0] / 200.0 : 0;
        }
    }
    CHECK(next > 3900 && fabs(out - in) < 0.1); /* counts x s: rounding of 3800 samples */
}

static void test_a_gap_is_missing_and_a_limit_stays_one(void)
{
    struct hs_resampler r;
    const int16_t small[6] = {10, 10, 10, 10, 10, 10}, large[6] = {28571, 10, 10, -32768, 10, 10};
    start(&r, 200, HS_SECOND);
    uint64_t t = HS_SECOND - 6 * HS_MILLISECOND;
    for (int k = 0; k < 50; k++) {
        t += k == 20 ? 30 * HS_MILLISECOND : 2 * HS_MILLISECOND;
        hs_resampler_push(&r, t, k == 30 ? large : small);
    }
    int missing = 0, limited = 0;
    for (uint32_t k = 0; k < r.grid.index; k++) {
        const int16_t *sample = hs_resampler_at(&r, k);
        missing += sample == NULL ? 1 : 0;
        limited += sample != NULL && sample[0] == 28571 && sample[3] == -32767 ? 1 : 0;
    }
    CHECK(missing >= 6 && missing <= 8);
    CHECK(limited == 1 || limited == 2);
}

int main(void)
{
    test_a_grid_does_not_drift();
    test_a_clock_is_measured_to_some_ppm_in_eight_seconds();
    test_a_counter_that_was_set_anew_is_followed();
    test_the_angle_is_kept();
    test_a_gap_is_missing_and_a_limit_stays_one();
    PASSED();
    return 0;
}

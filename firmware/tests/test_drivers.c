/* Drivers against their chips' registers: who is there, what counts mean, what cannot be set. */
#include "tests/bench.h"

static const struct hs_strip_layout strips[3] = {
    {.slot = 0, .count = 1, .points = {5}, .drivers = {&hs_icm42688p, &hs_mmc5983ma}},
    {.slot = 1,
     .count = 1,
     .points = {6},
     .drivers = {&hs_lsm6dsv16x, NULL},
     .i2c_address = {0x6A, 0}},
    {.slot = 2, .count = 1, .points = {7}, .drivers = {&hs_icm42688p, NULL}},
};
static const struct hs_layout layout = {
    .device_id = 1, .hand = HS_RIGHT, .name = "test", .strips = strips, .count = 3};

static void prepare(void)
{
    bench_clear();
    sim_start(&layout, 11, false);
}

static void test_a_chip_is_known_by_its_register_and_none_passes_for_another(void)
{
    static const struct hs_driver *const drivers[3] = {&hs_icm42688p, &hs_lsm6dsv16x,
                                                       &hs_mmc5983ma};
    const struct hs_bus buses[4] = {{0, 0, 0}, {1, 0, 0x6A}, {0, HS_PER_STRIP, 0}, {5, 0, 0}};
    prepare();
    for (int b = 0; b < 4; b++) {
        for (int d = 0; d < 3; d++) {
            CHECK(drivers[d]->probe(&buses[b]) == (b == d));
        }
    }
}

static void test_ranges_reach_what_is_asked_for(const struct hs_driver *driver, float widest)
{
    struct hs_setting s;
    for (float dps = 0; dps <= widest; dps += 7.5f) {
        const float ranges[2] = {dps * HS_DEGREE, dps / widest * 16 * HS_STANDARD_GRAVITY};
        CHECK(driver->choose(400, ranges, &s));
        CHECK(s.full_scale[0] >= ranges[0] * 0.998f && s.full_scale[1] >= ranges[1] * 0.998f &&
              s.hz >= 400);
        CHECK(dps == 0 || s.full_scale[0] <= 2.01f * ranges[0] ||
              s.full_scale[0] < 126 * HS_DEGREE);
        CHECK(s.full_scale[0] / s.scale[0] <= 32769 && s.full_scale[1] / s.scale[1] <= 32800);
    }
    const float none[2] = {0, 0}, fast[2] = {1.01f * widest * HS_DEGREE, 0},
                hard[2] = {0, 17 * HS_STANDARD_GRAVITY};
    CHECK(!driver->choose(1e9f, none, &s) && !driver->choose(400, fast, &s) &&
          !driver->choose(400, hard, &s));
}

/* At rest with the chip's z axis up on the back of a right hand that has no mounting: gravity along
 * -x. */
static void test_counts_times_scale_are_si(const struct hs_bus *bus, const struct hs_driver *driver)
{
    static struct hs_reading readings[512];
    struct hs_partial partial = {0};
    struct hs_setting s;
    const float wanted[2] = {500 * HS_DEGREE, 4 * HS_STANDARD_GRAVITY};
    float celsius = 0;
    prepare();
    CHECK(driver->probe(bus) && driver->reset(bus) && driver->choose(400, wanted, &s) &&
          driver->configure(bus, &s));
    bench.now += 200 * HS_MILLISECOND;
    const int n = driver->drain(bus, &partial, readings, 512);
    CHECK(n > 0.19 * (double)s.hz && n < 0.21 * (double)s.hz + 1);
    for (int k = 0; k < n; k++) {
        const float x = (float)readings[k].value[3] * s.scale[1],
                    turn = (float)readings[k].value[2] * s.scale[0];
        CHECK(x < -9.7f && x > -9.9f && turn < 0.02f && turn > -0.02f);
        CHECK(k == 0 ||
              (readings[k].ticks - readings[k - 1].ticks) * (double)driver->tick * (double)s.hz <
                  1.05e9);
    }
    CHECK(driver->temperature(bus, &celsius) && celsius > 30.9f && celsius < 31.1f);
    CHECK(driver->drain(bus, &partial, readings, 512) <= 4); /* what came while it was emptied */
}

static void test_a_magnetometer_gives_tesla(void)
{
    struct hs_reading reading;
    struct hs_setting s;
    const struct hs_bus bus = {0, HS_PER_STRIP, 0};
    const float none[2] = {0, 0};
    prepare();
    CHECK(hs_mmc5983ma.choose(100, none, &s) && hs_mmc5983ma.configure(&bus, &s));
    hs_mmc5983ma.drain(&bus, NULL, &reading, 1);
    bench.now += 30 * HS_MILLISECOND;
    CHECK(hs_mmc5983ma.drain(&bus, NULL, &reading, 1) == 1);
    CHECK((float)reading.value[0] * s.scale[0] < -44e-6f &&
          (float)reading.value[0] * s.scale[0] > -46e-6f);
    CHECK(hs_mmc5983ma.drain(&bus, NULL, &reading, 1) == 0); /* one reading is given once */
}

int main(void)
{
    test_a_chip_is_known_by_its_register_and_none_passes_for_another();
    test_ranges_reach_what_is_asked_for(&hs_icm42688p, 2000);
    test_ranges_reach_what_is_asked_for(&hs_lsm6dsv16x, 4000);
    test_counts_times_scale_are_si(&(struct hs_bus){2, 0, 0}, &hs_icm42688p);
    test_counts_times_scale_are_si(&(struct hs_bus){1, 0, 0x6A}, &hs_lsm6dsv16x);
    test_a_magnetometer_gives_tesla();
    PASSED();
    return 0;
}

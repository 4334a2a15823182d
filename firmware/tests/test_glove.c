/* A whole glove on simulated chips: what it must do by docs/wire-protocol.md, and what it answers
 * to what it cannot do. */
#include "core/hand_layout.h"
#include "tests/bench.h"

static struct hs_strip_layout strips[HS_STRIPS];
static struct hs_layout layout = {
    .device_id = 0xFEED, .hand = HS_LEFT, .name = "test glove", .strips = strips};
static struct hs_frame frame;

static void power_up(const char *names, const struct hs_driver *chip)
{
    layout.count = hs_hand_layout(names, layout.hand, chip, strips);
    CHECK(layout.count > 0);
    bench_power_up(&layout);
}

static void start(void)
{
    bench_forget();
    bench_command(HS_START, NULL, 0);
}

struct tally {
    uint32_t bursts, samples, lost, missing, next;
    uint64_t first, newest;
    bool began;
};

/* Add what was sent of one stream with int16 samples of so many sensors. */
static struct tally tally_of(uint8_t stream, uint8_t sensors)
{
    struct tally t = {0};
    while (bench_find(HS_SAMPLES, &frame)) {
        struct hs_reader r = {frame.payload, frame.size, 0, false};
        if (hs_get_uint(&r, 1) != stream) {
            continue;
        }
        const uint32_t index = (uint32_t)hs_get_uint(&r, 4);
        const uint64_t first = hs_get_uint(&r, 8), sent = hs_get_uint(&r, 8);
        const uint8_t count = (uint8_t)hs_get_uint(&r, 1);
        CHECK(sent > first && sent - first < 60 * HS_MILLISECOND);
        CHECK(frame.size == 22 + (size_t)count * sensors * 12);
        t.lost += t.began ? index - t.next : 0;
        t.first = t.began ? t.first : first;
        t.began = true;
        t.next = index + count;
        t.newest = first;
        t.bursts++;
        t.samples += count;
        for (uint32_t k = 0; k < count * 6u * sensors; k++) {
            t.missing += (int16_t)hs_get_uint(&r, 2) == HS_MISSING ? 1 : 0;
        }
    }
    return t;
}

static void test_identity_is_the_first_frame_and_boots_differ(void)
{
    uint32_t boots[2];
    for (int k = 0; k < 2; k++) {
        power_up("index", &hs_icm42688p);
        sim.random += (uint32_t)k;
        CHECK(bench_next(&frame) && frame.type == HS_IDENTITY && frame.sequence == 0);
        boots[k] = frame.payload[10] | (uint32_t)frame.payload[11] << 8;
        sim.random = 99;
        CHECK(hs_glove_start(&bench_glove, &layout) == NULL);
        boots[k] ^= k == 0 ? bench_glove.identity.boot_id & 0xFFFF : 0;
    }
    CHECK(boots[0] != 0);
}

static void test_samples_are_even_and_none_is_lost(const struct hs_driver *chip)
{
    power_up(HS_WHOLE_HAND, chip);
    start();
    bench_run(5);
    const struct tally t = tally_of(4, 3);
    CHECK(t.samples >= 985 && t.lost == 0 && t.missing == 0 && t.bursts == t.samples / 2);
    CHECK(t.newest - t.first == (uint64_t)(t.samples - 2) * 5 * HS_MILLISECOND);
    for (int s = 0; s < 7; s++) {
        for (int k = 0; k < bench_glove.strips[s].count; k++) {
            const struct hs_sensor *sensor = &bench_glove.strips[s].streams[0].sensors[k];
            CHECK(sensor->tested && sensor->passed);
            const double truth = sim_chip_at(sensor->bus.slot, sensor->bus.select)->error_ppm;
            const double measured =
                1e6 * ((double)hs_sensor_true_rate(sensor) / sensor->setting.hz - 1);
            CHECK(measured - truth < 30 && truth - measured < 30);
        }
    }
}

static void test_descriptions_are_repeated_each_second(void)
{
    int strip = 0, info = 0, status = 0, calibration = 0;
    power_up("thumb,index", &hs_icm42688p);
    start();
    bench_forget();
    bench_run(3.05);
    while (bench_next(&frame)) {
        strip += frame.type == HS_STRIP;
        info += frame.type == HS_STREAM_INFO;
        status += frame.type == HS_STATUS;
        calibration += frame.type == HS_CALIBRATION;
    }
    CHECK(strip == 6 && info == 6 && status == 3 && calibration == 18);
}

/* Whether this strip was described so; what was sent before is passed over. */
static bool is_described(uint8_t slot, uint8_t attached)
{
    while (bench_find(HS_STRIP, &frame)) {
        if (frame.payload[0] == slot && (frame.payload[1] & 1) == attached) {
            return true;
        }
    }
    return false;
}

static void test_a_strip_is_pulled_and_plugged_while_running(void)
{
    power_up("hand,index", &hs_lsm6dsv16x);
    start();
    bench_run(1);
    bench_forget();
    sim_plug(2, false);
    bench_run(0.5);
    CHECK(is_described(2, 0));
    CHECK(tally_of(4, 3).samples == 0); /* none after the message that it was pulled */
    bench_forget();
    sim_plug(2, true);
    bench_run(2);
    CHECK(is_described(2, 1));
    const struct tally t = tally_of(4, 3);
    CHECK(t.samples > 200 && t.lost == 0 && t.missing == 0);
}

static void test_the_other_strips_go_on_without_a_gap(void)
{
    power_up("hand,index", &hs_icm42688p);
    start();
    for (int k = 0; k < 6; k++) {
        sim_plug(2, k % 2 == 1);
        bench_run(0.7);
    }
    const struct tally t = tally_of(0, 1);
    CHECK(t.samples > 800 && t.lost == 0 && t.missing == 0);
}

static void test_a_sensor_that_dies_is_missing_and_comes_back(void)
{
    power_up("index", &hs_icm42688p);
    start();
    bench_run(1);
    sim_chip_at(2, 1)->broken = true;
    bench_run(0.5);
    bench_forget();
    bench_run(1);
    struct tally t = tally_of(4, 3);
    CHECK(t.lost == 0 && t.missing == t.samples * 6);
    sim_chip_at(2, 1)->broken = false;
    sim_chip_power(sim_chip_at(2, 1));
    bench_run(1);
    bench_forget();
    bench_run(1);
    t = tally_of(4, 3);
    CHECK(t.samples >= 196 && t.missing == 0);
}

static void test_a_slow_host_loses_whole_frames_that_are_counted(void)
{
    power_up(HS_WHOLE_HAND, &hs_icm42688p);
    start();
    bench_run(0.5);
    bench_forget();
    bench.room = 0;
    bench_run(2);
    CHECK(bench_glove.outbox.overruns > 100);
    bench.room = BENCH_WIRE;
    bench_run(1.5);
    const struct tally t = tally_of(4, 3);
    CHECK(t.lost > 100 && t.samples + t.lost > 690);
    bench_forget();
    bench_run(1.1);
    CHECK(bench_find(HS_STATUS, &frame) &&
          frame.payload[8] + 256u * frame.payload[9] == (bench_glove.outbox.overruns & 0xFFFF));
}

static int configure(uint8_t slot, double rate, double mag, float gyr, float acc, uint8_t format)
{
    uint8_t payload[32];
    struct hs_writer w = {payload, sizeof payload, 0, false};
    hs_put_uint(&w, slot, 1);
    hs_put_f64(&w, rate);
    hs_put_f64(&w, mag);
    hs_put_f32(&w, gyr);
    hs_put_f32(&w, acc);
    hs_put_uint(&w, format, 1);
    bench_forget();
    bench_command(HS_CONFIGURE, payload, w.at);
    return bench_reply(HS_CONFIGURE);
}

static void test_rates_and_ranges_that_cannot_be_are_refused(void)
{
    const double nan = strtod("nan", NULL), infinite = strtod("inf", NULL);
    power_up("index,trunk_mag", &hs_icm42688p);
    CHECK(configure(255, 1e9, 0, 0, 0, 0) == HS_BAD_ARGUMENT &&
          configure(255, -1, 0, 0, 0, 0) == HS_BAD_ARGUMENT);
    CHECK(configure(255, nan, 0, 0, 0, 0) == HS_BAD_ARGUMENT &&
          configure(255, infinite, 0, 0, 0, 0) == HS_BAD_ARGUMENT);
    CHECK(configure(255, 1e-300, 0, 0, 0, 0) == HS_BAD_ARGUMENT &&
          configure(255, 0, 101, 0, 0, 0) == HS_BAD_ARGUMENT);
    CHECK(configure(255, 0, 0, 1e6f, 0, 0) == HS_BAD_ARGUMENT &&
          configure(255, 0, 0, 0, 1e6f, 0) == HS_BAD_ARGUMENT);
    CHECK(configure(255, 0, 0, (float)nan, 0, 0) == HS_BAD_ARGUMENT &&
          configure(255, 0, 0, 0, 0, 2) == HS_BAD_ARGUMENT);
    CHECK(configure(63, 100, 0, 0, 0, 0) == HS_BAD_ARGUMENT);
    CHECK(bench_glove.strips[0].streams[0].rate == 200 &&
          bench_glove.strips[1].streams[1].rate == 50);
    CHECK(configure(255, 0, 0, 0, 0, 0) == HS_DONE && bench_glove.strips[0].streams[0].rate == 200);
    start();
    CHECK(configure(255, 100, 0, 0, 0, 0) == HS_BUSY);
}

static void test_another_rate_and_range_hold_from_the_next_start(void)
{
    power_up("index", &hs_icm42688p);
    for (int k = 0; k < 4; k++) {
        const double rate = (double[]){1, 119.5, 500, 1000}[k];
        CHECK(configure(2, rate, 0, 8.5f, 35, 0) == HS_DONE);
        CHECK(bench_glove.strips[0].streams[0].setting.full_scale[0] > 8.5f &&
              bench_glove.strips[0].streams[0].setting.full_scale[0] < 9);
        start();
        bench_run(4);
        const struct tally t = tally_of(4, 3);
        CHECK(t.lost == 0 && t.missing == 0 && t.samples > 3.7 * rate - 2 &&
              t.samples < 4.01 * rate);
        bench_command(HS_STOP, NULL, 0);
        bench_forget();
        bench_run(0.5);
        CHECK(tally_of(4, 3).samples == 0);
    }
}

static int write_calibration(uint8_t slot, uint8_t sensor, float bias)
{
    uint8_t payload[160];
    struct hs_writer w = {payload, sizeof payload, 0, false};
    struct hs_calibration c;
    hs_identity_calibration(&c);
    c.bias[0] = bias;
    hs_write_calibration(&w, slot, sensor, &c);
    bench_forget();
    bench_command(HS_WRITE_CALIBRATION, payload, w.at);
    bench_run(0.2);
    return bench_reply(HS_WRITE_CALIBRATION);
}

static void test_a_calibration_outlives_the_strip_being_pulled(void)
{
    power_up("thumb,index", &hs_icm42688p);
    const uint64_t id = bench_glove.strips[1].record.strip_id;
    CHECK(id != 0 && id != bench_glove.strips[0].record.strip_id);
    CHECK(write_calibration(2, 1, 0.25f) == HS_DONE);
    sim_plug(2, false);
    bench_run(0.5);
    CHECK(write_calibration(2, 1, 0.5f) == HS_BAD_ARGUMENT);
    sim_plug(2, true);
    bench_run(1);
    CHECK(bench_glove.strips[1].record.strip_id == id &&
          bench_glove.strips[1].record.calibration[1].bias[0] == 0.25f);
    CHECK(write_calibration(2, 3, 1) == HS_BAD_ARGUMENT &&
          write_calibration(9, 0, 1) == HS_BAD_ARGUMENT);
    CHECK(write_calibration(2, 0, strtof("nan", NULL)) == HS_BAD_ARGUMENT);
    start();
    CHECK(write_calibration(2, 0, 1) == HS_BUSY);
}

static void test_a_memory_that_keeps_nothing_is_reported_and_the_recording_goes_on(void)
{
    power_up("index", &hs_icm42688p);
    sim.supply = 40;
    CHECK(write_calibration(2, 0, 1) == HS_BAD_ARGUMENT &&
          bench_glove.strips[0].record.calibration[0].bias[0] == 0);
    start();
    bench_run(1);
    CHECK(tally_of(4, 3).samples > 180);
}

static void test_strange_commands_are_answered(void)
{
    power_up("index", &hs_icm42688p);
    bench_command(0x99, NULL, 0);
    CHECK(bench_reply(0x99) == HS_UNKNOWN_COMMAND);
    bench_command(HS_PING, "1234", 4);
    CHECK(bench_reply(HS_PING) == HS_BAD_ARGUMENT);
    bench_command(HS_CUE, "\x07tapping", 8);
    CHECK(bench_reply(HS_CUE) == HS_DONE);
    bench_command(HS_CUE,
                  "\xff"
                  "tapping",
                  8);
    CHECK(bench_reply(HS_CUE) == HS_BAD_ARGUMENT);
    bench_command(HS_READ_CALIBRATION, "\x40", 1);
    CHECK(bench_reply(HS_READ_CALIBRATION) == HS_BAD_ARGUMENT);
    bench_forget();
    bench_command(HS_IDENTITY, "from another glove", 18); /* no command: passed over */
    CHECK(!bench_next(&frame));
}

static void test_sixty_four_strips_are_served_and_a_slot_that_is_taken_is_refused(void)
{
    static struct hs_strip_layout many[65];
    struct hs_layout large = {
        .device_id = 1, .hand = HS_LEFT, .name = "large", .strips = many, .count = 64};
    for (int k = 0; k < 65; k++) {
        many[k] = (struct hs_strip_layout){
            .slot = (uint8_t)k, .count = 3, .points = {5, 6, 7}, .drivers = {&hs_icm42688p, NULL}};
    }
    bench_power_up(&large);
    bench.bus_ns = 100; /* twelve buses as one: a single one has no room for 192 sensors */
    bench_run(1);
    start();
    bench_run(1);
    const struct tally t = tally_of(2 * 63, 3);
    CHECK(t.samples > 150 && t.lost == 0 && t.missing == 0 && bench_glove.outbox.overruns == 0);
    many[63].slot = 5;
    CHECK(hs_glove_start(&bench_glove, &large) != NULL);
    many[63].slot = 63;
    large.count = 65;
    CHECK(hs_glove_start(&bench_glove, &large) != NULL);
    large.count = 64;
    many[0].count = 9;
    CHECK(hs_glove_start(&bench_glove, &large) != NULL);
}

static void test_a_supply_that_fails_is_marked_once(void)
{
    power_up("index", &hs_icm42688p);
    start();
    bench.supply_low = true;
    bench_run(0.5);
    CHECK(bench_find(HS_MARK, &frame) && !bench_find(HS_MARK, &frame));
    bench.supply_low = false;
}

int main(void)
{
    test_identity_is_the_first_frame_and_boots_differ();
    test_samples_are_even_and_none_is_lost(&hs_icm42688p);
    test_samples_are_even_and_none_is_lost(&hs_lsm6dsv16x);
    test_descriptions_are_repeated_each_second();
    test_a_strip_is_pulled_and_plugged_while_running();
    test_the_other_strips_go_on_without_a_gap();
    test_a_sensor_that_dies_is_missing_and_comes_back();
    test_a_slow_host_loses_whole_frames_that_are_counted();
    test_rates_and_ranges_that_cannot_be_are_refused();
    test_another_rate_and_range_hold_from_the_next_start();
    test_a_calibration_outlives_the_strip_being_pulled();
    test_a_memory_that_keeps_nothing_is_reported_and_the_recording_goes_on();
    test_strange_commands_are_answered();
    test_sixty_four_strips_are_served_and_a_slot_that_is_taken_is_refused();
    test_a_supply_that_fails_is_marked_once();
    PASSED();
    return 0;
}

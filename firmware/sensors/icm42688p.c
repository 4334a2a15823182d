/* ICM-42688-P, inertial sensor: TDK DS-000347. FIFO packet 3 (16 bytes): header, acc, gyr,
 * temperature, time stamp; big-endian. */
#include "core/messages.h"
#include "sensors/driver.h"

enum {
    DEVICE_CONFIG = 0x11,
    FIFO_CONFIG = 0x16,
    TEMP_DATA1 = 0x1D,
    ACCEL_DATA_X1 = 0x1F,
    FIFO_COUNTH = 0x2E,
    FIFO_DATA = 0x30,
    SIGNAL_PATH_RESET = 0x4B,
    INTF_CONFIG0 = 0x4C,
    PWR_MGMT0 = 0x4E,
    GYRO_CONFIG0 = 0x4F,
    ACCEL_CONFIG0 = 0x50,
    GYRO_ACCEL_CONFIG0 = 0x52,
    TMST_CONFIG = 0x54,
    FIFO_CONFIG1 = 0x5F,
    TMSTVAL0 = 0x62, /* bank 1 */
    SELF_TEST_CONFIG = 0x70,
    WHO_AM_I = 0x75,
    REG_BANK_SEL = 0x76
};

enum { PACKET = 16, AT_ONCE = 8, MOST = 2048 / PACKET };
#define HEADER_EMPTY 0x80
#define HEADER_BOTH 0x60 /* acc and gyr in the packet */

static bool probe(const struct hs_bus *bus)
{
    uint8_t who = 0;
    return hs_read_registers(bus, WHO_AM_I, &who, 1) && who == 0x47;
}

static bool reset(const struct hs_bus *bus)
{
    return hs_write_register(bus, REG_BANK_SEL, 0) && hs_write_register(bus, DEVICE_CONFIG, 1);
}

static bool choose(float hz, const float *ranges, struct hs_setting *s)
{
    static const struct {
        float hz;
        uint8_t code;
    } rates[] = {{50, 9}, {100, 8}, {200, 7}, {500, 15}, {1000, 6}, {2000, 5}};
    static const float gyr_dps[] = {2000, 1000, 500, 250, 125},
                       acc_g[] = {16, 8, 4, 2}; /* by code */
    const float wanted[2] = {ranges[0] / HS_DEGREE, ranges[1] / HS_STANDARD_GRAVITY};
    size_t k = 0;
    while (k < 6 && rates[k].hz < hz) {
        k++;
    }
    if (k == 6 || wanted[0] > 2000.5f || wanted[1] > 16.01f) {
        return false;
    }
    s->rate = rates[k].code;
    s->hz = rates[k].hz;
    s->range[0] = s->range[1] = 0;
    while (wanted[0] > 0 && s->range[0] < 4 && gyr_dps[s->range[0] + 1] >= wanted[0] * 0.999f) {
        s->range[0]++;
    }
    while (wanted[1] > 0 && s->range[1] < 3 && acc_g[s->range[1] + 1] >= wanted[1] * 0.999f) {
        s->range[1]++;
    }
    s->full_scale[0] = gyr_dps[s->range[0]] * HS_DEGREE;
    s->full_scale[1] = acc_g[s->range[1]] * HS_STANDARD_GRAVITY;
    for (int q = 0; q < 2; q++) {
        s->scale[q] = s->full_scale[q] / 32768.0f;
    }
    return true;
}

static bool configure(const struct hs_bus *bus, const struct hs_setting *s)
{
    const uint8_t pairs[][2] = {
        {REG_BANK_SEL, 0},
        {INTF_CONFIG0, bus->i2c_address == 0
                           ? 0x73
                           : 0x70}, /* FIFO counted in packets, big-endian; over SPI no I2C */
        {FIFO_CONFIG, 0},           /* bypass while it is set up */
        {GYRO_CONFIG0, (uint8_t)(s->range[0] << 5 | s->rate)},
        {ACCEL_CONFIG0, (uint8_t)(s->range[1] << 5 | s->rate)},
        {GYRO_ACCEL_CONFIG0, 0x11}, /* bandwidth a quarter of the rate */
        {TMST_CONFIG, 0x29},        /* stamps on, 16 us, of the sample and not of a change */
        {FIFO_CONFIG1, 0x07},       /* acc, gyr, temperature */
        {PWR_MGMT0, 0x0F},          /* both in low-noise mode */
        {FIFO_CONFIG, 0x40},        /* stream */
    };
    const bool done = hs_write_registers(bus, pairs, sizeof pairs / sizeof pairs[0]);
    board_wait(200); /* no register may be written for 200 us after PWR_MGMT0 */
    return done && hs_write_register(bus, SIGNAL_PATH_RESET, 0x02);
}

static bool excite(const struct hs_bus *bus, bool on)
{
    return hs_write_register(bus, SELF_TEST_CONFIG, on ? 0x7F : 0);
}

static bool read_now(const struct hs_bus *bus, int16_t *value)
{
    uint8_t b[12];
    if (!hs_read_registers(bus, ACCEL_DATA_X1, b, sizeof b)) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        value[k] = hs_big(b + 6 + 2 * k);
        value[3 + k] = hs_big(b + 2 * k);
    }
    return true;
}

static bool sync(const struct hs_bus *bus, uint32_t *ticks)
{
    uint8_t b[3] = {0, 0, 0};
    bool done =
        hs_write_register(bus, SIGNAL_PATH_RESET, 0x04); /* strobe: the counter is latched now */
    done = hs_write_register(bus, REG_BANK_SEL, 1) && done;
    done = hs_read_registers(bus, TMSTVAL0, b, sizeof b) && done;
    done = hs_write_register(bus, REG_BANK_SEL, 0) && done;
    *ticks = (uint32_t)(b[0] | b[1] << 8 | (b[2] & 15) << 16);
    return done;
}

static bool take_packet(const uint8_t *p, struct hs_reading *r)
{
    if ((p[0] & HEADER_EMPTY) != 0 || (p[0] & HEADER_BOTH) != HEADER_BOTH) {
        return false;
    }
    bool valid = true;
    for (int k = 0; k < 3; k++) {
        r->value[k] = hs_big(p + 7 + 2 * k);
        r->value[3 + k] = hs_big(p + 1 + 2 * k);
        valid = valid && r->value[k] != HS_MISSING &&
                r->value[3 + k] != HS_MISSING; /* -32768: not measured */
    }
    r->ticks = (uint16_t)hs_big(p + 14);
    return valid;
}

static int drain(const struct hs_bus *bus, struct hs_partial *partial, struct hs_reading *readings,
                 int most)
{
    uint8_t b[PACKET * AT_ONCE];
    const int at_once = bus->i2c_address == 0 ? AT_ONCE : HS_I2C_BYTES / PACKET;
    int taken = 0;
    (void)partial;
    if (!hs_read_registers(bus, FIFO_COUNTH, b, 2)) {
        return -1;
    }
    int left = b[0] << 8 | b[1];
    if (left > MOST) {
        return -1; /* nobody answers */
    }
    while (left > 0 && taken < most) {
        int n = left < at_once ? left : at_once;
        n = n < most - taken ? n : most - taken;
        if (!hs_read_registers(bus, FIFO_DATA, b, (size_t)n * PACKET)) {
            return -1;
        }
        for (int k = 0; k < n; k++) {
            taken += take_packet(b + k * PACKET, &readings[taken]) ? 1 : 0;
        }
        left -= n;
    }
    return taken;
}

static bool temperature(const struct hs_bus *bus, float *celsius)
{
    uint8_t b[2];
    if (!hs_read_registers(bus, TEMP_DATA1, b, 2)) {
        return false;
    }
    *celsius = (float)hs_big(b) / 132.48f + 25.0f;
    return true;
}

/* Self-test at 2000 deg/s (16.4 counts a deg/s) and 16 g (2048 a g): at least 60 deg/s; 50 to 1200
 * mg. */
const struct hs_driver hs_icm42688p = {
    .name = "ICM-42688-P",
    .quantities = HS_GYR | HS_ACC,
    .axes = 6,
    .has_clock = true,
    .stamp_bits = 16,
    .sync_bits = 20,
    .tick = 16000,
    .start_ms = 2,
    .settle_ms = 60,
    .test_least = {984, 984, 984, 102, 102, 102},
    .test_most = {32767, 32767, 32767, 2458, 2458, 2458},
    .probe = probe,
    .reset = reset,
    .choose = choose,
    .configure = configure,
    .excite = excite,
    .read_now = read_now,
    .sync = sync,
    .drain = drain,
    .temperature = temperature,
};

/* LSM6DSV16X, inertial sensor: ST DS13510. A FIFO word has 7 bytes: tag, 6 of data; gyr, acc and
 * time stamp of a sample share a count of 2 bits. */
#include "core/messages.h"
#include "sensors/driver.h"

enum {
    IF_CFG = 0x03,
    FIFO_CTRL3 = 0x09,
    FIFO_CTRL4 = 0x0A,
    WHO_AM_I = 0x0F,
    CTRL1 = 0x10,
    CTRL2 = 0x11,
    CTRL3 = 0x12,
    CTRL6 = 0x15,
    CTRL7 = 0x16,
    CTRL8 = 0x17,
    CTRL9 = 0x18,
    CTRL10 = 0x19,
    FIFO_STATUS1 = 0x1B,
    OUT_TEMP_L = 0x20,
    OUTX_L_G = 0x22,
    TIMESTAMP0 = 0x40,
    FUNCTIONS_ENABLE = 0x50,
    HAODR_CFG = 0x62,
    FIFO_DATA_OUT_TAG = 0x78
};

enum { WORD = 7, AT_ONCE = 18, MOST = 511, TAG_GYR = 1, TAG_ACC = 2, TAG_TIME = 4, COMPLETE = 7 };
#define HIGH_ACCURACY 0x10 /* operating mode of both sensors, CTRL1 and CTRL2 */

static bool probe(const struct hs_bus *bus)
{
    uint8_t who = 0;
    return hs_read_registers(bus, WHO_AM_I, &who, 1) && who == 0x70;
}

static bool reset(const struct hs_bus *bus) { return hs_write_register(bus, CTRL3, 0x01); }

static bool choose(float hz, const float *ranges, struct hs_setting *s)
{
    static const float rates[] = {50,  100, 200,
                                  400, 800, 1600}; /* codes 5 to 10 where HAODR_SEL is 2 */
    static const float gyr_dps[] = {125, 250, 500, 1000, 2000, 4000},
                       gyr_mdps[] = {4.375f, 8.75f, 17.5f, 35, 70, 140};
    static const float acc_g[] = {2, 4, 8, 16}, acc_mg[] = {0.061f, 0.122f, 0.244f, 0.488f};
    const float wanted[2] = {ranges[0] > 0 ? ranges[0] / HS_DEGREE : 2000,
                             ranges[1] > 0 ? ranges[1] / HS_STANDARD_GRAVITY : 16};
    size_t rate = 0, gyr = 0, acc = 0;
    while (rate < 6 && rates[rate] < hz) {
        rate++;
    }
    while (gyr < 6 && gyr_dps[gyr] < wanted[0] * 0.999f) {
        gyr++;
    }
    while (acc < 4 && acc_g[acc] < wanted[1] * 0.999f) {
        acc++;
    }
    if (rate == 6 || gyr == 6 || acc == 4) {
        return false;
    }
    s->rate = (uint8_t)(5 + rate);
    s->hz = rates[rate];
    s->range[0] = (uint8_t)gyr;
    s->range[1] = (uint8_t)acc;
    s->full_scale[0] = gyr_dps[gyr] * HS_DEGREE;
    s->full_scale[1] = acc_g[acc] * HS_STANDARD_GRAVITY;
    s->scale[0] = gyr_mdps[gyr] * 1e-3f * HS_DEGREE;
    s->scale[1] = acc_mg[acc] * 1e-3f * HS_STANDARD_GRAVITY;
    return true;
}

static bool configure(const struct hs_bus *bus, const struct hs_setting *s)
{
    const uint8_t pairs[][2] = {
        {CTRL1, 0}, /* off while rates and ranges change */
        {CTRL2, 0},
        {IF_CFG, bus->i2c_address == 0
                     ? 1
                     : 0}, /* over SPI no I2C: it would listen to the other chips' traffic */
        {CTRL3, 0x44},     /* registers of one sample together; addresses count up */
        {FIFO_CTRL4, 0},   /* empties it */
        {HAODR_CFG, 0x02}, /* rates of 12.5 Hz times a power of two */
        {CTRL6, (uint8_t)(0x10 | s->range[0])}, /* low-pass: the second of eight */
        {CTRL7, 0x01},                          /* low-pass of the gyroscope on */
        {CTRL8, (uint8_t)(0x00 | s->range[1])}, /* bandwidth a quarter of the rate */
        {CTRL9, 0x08},                          /* low-pass of the accelerometer on */
        {FUNCTIONS_ENABLE, 0x40},               /* time stamps */
        {CTRL1, (uint8_t)(HIGH_ACCURACY | s->rate)},
        {CTRL2, (uint8_t)(HIGH_ACCURACY | s->rate)},
        {FIFO_CTRL3, (uint8_t)(s->rate << 4 | s->rate)},
        {FIFO_CTRL4, 0x46}, /* a stamp with every sample, continuous */
    };
    return hs_write_registers(bus, pairs, sizeof pairs / sizeof pairs[0]);
}

static bool excite(const struct hs_bus *bus, bool on)
{
    return hs_write_register(bus, CTRL10, on ? 0x05 : 0);
}

static bool read_now(const struct hs_bus *bus, int16_t *value)
{
    uint8_t b[12];
    if (!hs_read_registers(bus, OUTX_L_G, b, sizeof b)) {
        return false;
    }
    for (int k = 0; k < 6; k++) {
        value[k] = hs_little(b + 2 * k);
    }
    return true;
}

static bool sync(const struct hs_bus *bus, uint32_t *ticks)
{
    uint8_t b[4];
    const bool done = hs_read_registers(bus, TIMESTAMP0, b, sizeof b);
    *ticks =
        done ? (uint32_t)b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24
             : 0;
    return done;
}

/* True where the word completes a sample. */
static bool take_word(const uint8_t *word, struct hs_partial *p)
{
    const uint8_t tag = word[0] >> 3, count = (word[0] >> 1) & 3;
    if (count != p->count) {
        p->count = count;
        p->has = 0;
    }
    if (tag == TAG_TIME) {
        p->reading.ticks =
            (uint32_t)(uint16_t)hs_little(word + 1) | (uint32_t)(uint16_t)hs_little(word + 3) << 16;
        p->has |= 4;
    } else if (tag == TAG_GYR || tag == TAG_ACC) {
        for (int k = 0; k < 3; k++) {
            p->reading.value[(tag == TAG_ACC ? 3 : 0) + k] = hs_little(word + 1 + 2 * k);
        }
        p->has |= tag == TAG_ACC ? 2 : 1;
    }
    if (p->has != COMPLETE) {
        return false;
    }
    p->has = 0;
    return true;
}

static int drain(const struct hs_bus *bus, struct hs_partial *partial, struct hs_reading *readings,
                 int most)
{
    uint8_t b[WORD * AT_ONCE];
    const int at_once = bus->i2c_address == 0 ? AT_ONCE : HS_I2C_BYTES / WORD;
    int taken = 0;
    if (!hs_read_registers(bus, FIFO_STATUS1, b, 2) ||
        (b[1] & 0x06) != 0) { /* bits that are always 0: nobody answers */
        return -1;
    }
    int left = b[0] | (b[1] & 1) << 8;
    while (left > 0 && taken < most) {
        int n = left < at_once ? left : at_once;
        n = n < most - taken ? n : most - taken;
        if (!hs_read_registers(bus, FIFO_DATA_OUT_TAG, b, (size_t)n * WORD)) {
            return -1;
        }
        for (int k = 0; k < n; k++) {
            if (take_word(b + k * WORD, partial)) {
                readings[taken++] = partial->reading;
            }
        }
        left -= n;
    }
    return taken;
}

static bool temperature(const struct hs_bus *bus, float *celsius)
{
    uint8_t b[2];
    if (!hs_read_registers(bus, OUT_TEMP_L, b, 2)) {
        return false;
    }
    *celsius = (float)hs_little(b) / 256.0f + 25.0f;
    return true;
}

/* Self-test at 2000 deg/s (70 mdps a count) and 16 g (0.488 mg): 150 to 700 deg/s; 50 to 1700 mg.
 */
const struct hs_driver hs_lsm6dsv16x = {
    .name = "LSM6DSV16X",
    .quantities = HS_GYR | HS_ACC,
    .axes = 6,
    .has_clock = true,
    .stamp_bits = 32,
    .sync_bits = 32,
    .tick = 21701, /* 1 / 46080 Hz */
    .start_ms = 10,
    .settle_ms = 60,
    .test_least = {2143, 2143, 2143, 102, 102, 102},
    .test_most = {10000, 10000, 10000, 3484, 3484, 3484},
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

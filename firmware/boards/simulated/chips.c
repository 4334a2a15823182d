/* Registers and FIFOs of the inertial sensors and the magnetometer, as their data sheets describe
 * them. */
#include "boards/simulated/world.h"

/* Registers as the data sheets name them, written down here anew: a wrong address of a driver must
 * not be wrong here as well. */
enum {
    ICM_DEVICE_CONFIG = 0x11,
    ICM_FIFO_CONFIG = 0x16,
    ICM_TEMP_DATA1 = 0x1D,
    ICM_TEMP_DATA0 = 0x1E,
    ICM_ACCEL_DATA_X1 = 0x1F,
    ICM_GYRO_DATA_Z0 = 0x2A,
    ICM_FIFO_COUNTH = 0x2E,
    ICM_FIFO_COUNTL = 0x2F,
    ICM_FIFO_DATA = 0x30,
    ICM_SIGNAL_PATH_RESET = 0x4B,
    ICM_PWR_MGMT0 = 0x4E,
    ICM_GYRO_CONFIG0 = 0x4F,
    ICM_ACCEL_CONFIG0 = 0x50,
    ICM_TMSTVAL0 = 0x62, /* bank 1 */
    ICM_SELF_TEST_CONFIG = 0x70,
    ICM_WHO_AM_I = 0x75,
    ICM_REG_BANK_SEL = 0x76
};
enum {
    LSM_FIFO_CTRL4 = 0x0A,
    LSM_WHO_AM_I = 0x0F,
    LSM_CTRL2 = 0x11,
    LSM_CTRL3 = 0x12,
    LSM_CTRL6 = 0x15,
    LSM_CTRL8 = 0x17,
    LSM_CTRL10 = 0x19,
    LSM_FIFO_STATUS1 = 0x1B,
    LSM_FIFO_STATUS2 = 0x1C,
    LSM_OUT_TEMP_L = 0x20,
    LSM_OUT_TEMP_H = 0x21,
    LSM_OUTX_L_G = 0x22,
    LSM_OUTZ_H_A = 0x2D,
    LSM_TIMESTAMP0 = 0x40,
    LSM_TIMESTAMP3 = 0x43,
    LSM_HAODR_CFG = 0x62,
    LSM_FIFO_DATA_OUT_TAG = 0x78,
    LSM_FIFO_DATA_OUT_Z_H = 0x7E
};
enum { MMC_STATUS = 0x08, MMC_CONTROL1 = 0x0A, MMC_CONTROL2 = 0x0B, MMC_PRODUCT_ID = 0x2F };

#define NOISE 4 /* counts, largest of a uniform distribution */

static bool is_icm(const struct sim_chip *c) { return c->kind == &hs_icm42688p; }
static bool is_lsm(const struct sim_chip *c) { return c->kind == &hs_lsm6dsv16x; }

void sim_chip_power(struct sim_chip *c)
{
    memset(c->reg, 0, sizeof c->reg);
    c->bank = 0;
    c->first = c->used = c->lost = 0;
    c->powered = board_now();
    c->next = 0;
    if (is_icm(c)) {
        c->reg[0][ICM_WHO_AM_I] = 0x47;
    } else if (is_lsm(c)) {
        c->reg[0][LSM_WHO_AM_I] = 0x70;
        c->reg[0][LSM_CTRL3] = 0x44;
    } else {
        c->reg[0][MMC_PRODUCT_ID] = 0x30;
    }
}

/* Nominal rate that the registers ask for, 0: off. */
static uint32_t nominal_hz(const struct sim_chip *c)
{
    static const uint32_t icm[16] = {0,   32000, 16000, 8000, 4000, 2000, 1000, 200,
                                     100, 50,    25,    0,    0,    0,    0,    500};
    static const uint32_t lsm[16] = {0, 0, 0, 12, 25, 50, 100, 200, 400, 800, 1600};
    static const uint32_t mmc[8] = {0, 1, 10, 20, 50, 100, 200, 1000};
    if (is_icm(c)) {
        return (c->reg[0][ICM_PWR_MGMT0] & 0x0F) == 0x0F ? icm[c->reg[0][ICM_GYRO_CONFIG0] & 15]
                                                          : 0;
    }
    if (is_lsm(c)) {
        const bool high = (c->reg[0][LSM_CTRL2] >> 4) == 1 && c->reg[0][LSM_HAODR_CFG] == 2;
        return high ? lsm[c->reg[0][LSM_CTRL2] & 15] : 0;
    }
    return (c->reg[0][MMC_CONTROL2] & 8) != 0 ? mmc[c->reg[0][MMC_CONTROL2] & 7] : 0;
}

/* SI units of one count: of the gyroscope (quantity 0) or the accelerometer (1), or T. */
static float scale_of(const struct sim_chip *c, int quantity)
{
    static const float mg[4] = {0.061f, 0.122f, 0.244f, 0.488f};
    const uint8_t *r = c->reg[0];
    if (is_icm(c)) {
        return quantity == 0
                   ? (float)(2000 >> (r[ICM_GYRO_CONFIG0] >> 5)) * HS_DEGREE / 32768
                   : (float)(16 >> (r[ICM_ACCEL_CONFIG0] >> 5)) * HS_STANDARD_GRAVITY / 32768;
    }
    if (is_lsm(c)) {
        return quantity == 0 ? 4.375e-3f * (float)(1 << (r[LSM_CTRL6] & 15)) * HS_DEGREE
                             : mg[r[LSM_CTRL8] & 3] * 1e-3f * HS_STANDARD_GRAVITY;
    }
    return 2.44140625e-8f;
}

/* Vector from the segment's frame to the sensor's: v' = conj(q) v q. */
static void to_sensor(const float *q, const float *v, float *out)
{
    if (q == NULL) {
        memcpy(out, v, 3 * sizeof *v);
        return;
    }
    const float w = q[0], x = -q[1], y = -q[2], z = -q[3];
    const float a = 2 * (y * v[2] - z * v[1]), b = 2 * (z * v[0] - x * v[2]),
                c = 2 * (x * v[1] - y * v[0]);
    out[0] = v[0] + w * a + y * c - z * b;
    out[1] = v[1] + w * b + z * a - x * c;
    out[2] = v[2] + w * c + x * b - y * a;
}

static int16_t counts_of(float value, float scale, int32_t offset)
{
    const float counts = value / scale + (float)offset;
    return (int16_t)(counts > 32767    ? 32767
                     : counts < -32767 ? -32767
                     : counts < 0      ? counts - 0.5f
                                       : counts + 0.5f);
}

/* Take the sample at t: motion or field in the sensor's frame, with bias, noise and self-test. */
static void measure(struct sim_chip *c, uint64_t t)
{
    static const float field[3] = {-45e-6f, 18e-6f, 0};
    float truth[2][3], seen[2][3];
    const bool excited = is_icm(c) ? c->reg[0][ICM_SELF_TEST_CONFIG] == 0x7F
                                   : is_lsm(c) && c->reg[0][LSM_CTRL10] == 5;
    sim_motion(c->point, t, truth[0], truth[1]);
    if (c->kind->axes == 3) {
        memcpy(truth[0], field, sizeof field);
    }
    for (int q = 0; q < c->kind->axes / 3; q++) {
        to_sensor(c->mounting, truth[q], seen[q]);
        for (int k = 0; k < 3; k++) {
            const int32_t noise = (int32_t)(sim_draw() % (2 * NOISE + 1)) - NOISE,
                          push = !excited ? 0
                                 : q == 0 ? 4000
                                          : 500;
            c->newest[3 * q + k] =
                counts_of(seen[q][k], scale_of(c, q), c->bias[3 * q + k] + noise + push);
        }
    }
}

/* Append bytes to the FIFO; a packet that does not fit is lost and counted. */
static void queue(struct sim_chip *c, const uint8_t *bytes, uint32_t n)
{
    if (c->used + n > SIM_FIFO) {
        c->lost++;
        return;
    }
    for (uint32_t k = 0; k < n; k++) {
        c->fifo[(c->first + c->used++) % SIM_FIFO] = bytes[k];
    }
}

/* Time stamp counter of the chip, whose clock is off by error_ppm. */
static uint32_t ticks_at(const struct sim_chip *c, uint64_t t)
{
    const uint64_t passed = t - c->powered;
    const int64_t own = (int64_t)passed + (int64_t)(passed / 1000) * c->error_ppm / 1000;
    return (uint32_t)((uint64_t)own / c->kind->tick);
}

static void queue_icm(struct sim_chip *c, uint32_t ticks)
{
    uint8_t packet[16] = {0x68};
    for (int k = 0; k < 6; k++) {
        const uint16_t value = (uint16_t)c->newest[(k + 3) % 6];
        packet[1 + 2 * k] = (uint8_t)(value >> 8);
        packet[2 + 2 * k] = (uint8_t)value;
    }
    packet[14] = (uint8_t)(ticks >> 8);
    packet[15] = (uint8_t)ticks;
    queue(c, packet, sizeof packet);
}

static void queue_lsm(struct sim_chip *c, uint32_t ticks)
{
    uint8_t words[21] = {0};
    const uint8_t count = (uint8_t)((c->samples & 3) << 1);
    words[0] = (uint8_t)(1 << 3 | count);
    words[7] = (uint8_t)(2 << 3 | count);
    words[14] = (uint8_t)(4 << 3 | count);
    for (int k = 0; k < 6; k++) {
        const uint16_t value = (uint16_t)c->newest[k];
        words[(k < 3 ? 1 : 8) + 2 * (k % 3)] = (uint8_t)value;
        words[(k < 3 ? 2 : 9) + 2 * (k % 3)] = (uint8_t)(value >> 8);
    }
    for (int k = 0; k < 4; k++) {
        words[15 + k] = (uint8_t)(ticks >> (8 * k));
    }
    queue(c, words, sizeof words);
}

uint64_t sim_period(const struct sim_chip *c)
{
    const uint32_t hz = nominal_hz(c);
    const uint64_t nominal = hz > 0 ? HS_SECOND / hz : 0;
    return nominal - (uint64_t)((int64_t)nominal * c->error_ppm / 1000000);
}

/* Take the samples that are due by now. */
static void catch_up(struct sim_chip *c)
{
    const uint64_t now = board_now(), period = sim_period(c);
    if (period == 0) {
        c->next = 0;
        return;
    }
    if (c->next == 0 || now > c->next + HS_SECOND) {
        c->next = now + sim_draw() % (uint32_t)period;
    }
    for (; c->next <= now; c->next += period) {
        const bool fills = is_icm(c) ? (c->reg[0][ICM_FIFO_CONFIG] >> 6) == 1
                                     : (c->reg[0][LSM_FIFO_CTRL4] & 7) == 6;
        measure(c, c->next - period / 2); /* the mean over its period */
        c->samples++;
        if (is_icm(c) && fills) {
            queue_icm(c, ticks_at(c, c->next));
        } else if (is_lsm(c) && fills) {
            queue_lsm(c, ticks_at(c, c->next));
        } else if (!is_icm(c) && !is_lsm(c)) {
            c->reg[0][MMC_STATUS] |= 1;
        }
    }
}

static uint8_t next_of_fifo(struct sim_chip *c)
{
    if (c->used == 0) {
        return is_icm(c) ? 0xFF : 0;
    }
    const uint8_t byte = c->fifo[c->first];
    c->first = (c->first + 1) % SIM_FIFO;
    c->used--;
    return byte;
}

/* Low or high byte of what a sample's registers show; axes in the chip's order of registers. */
static uint8_t sample_byte(const struct sim_chip *c, uint8_t address)
{
    if (is_icm(c)) {
        const uint16_t value = (uint16_t)c->newest[((address - ICM_ACCEL_DATA_X1) / 2 + 3) % 6];
        return (uint8_t)((address - ICM_ACCEL_DATA_X1) % 2 == 0 ? value >> 8 : value);
    }
    if (is_lsm(c)) {
        const uint16_t value = (uint16_t)c->newest[(address - LSM_OUTX_L_G) / 2];
        return (uint8_t)((address - LSM_OUTX_L_G) % 2 == 0 ? value : value >> 8);
    }
    const uint16_t value = (uint16_t)(c->newest[address / 2] + 32768);
    return (uint8_t)(address % 2 == 0 ? value >> 8 : value);
}

static uint8_t read_register(struct sim_chip *c, uint8_t address)
{
    const uint32_t words = c->used / 7, packets = c->used / 16;
    if (is_icm(c) && c->bank == 0) {
        switch (address) {
        case ICM_TEMP_DATA1: return 0x03;
        case ICM_TEMP_DATA0: return 0x20; /* 31 deg C */
        case ICM_FIFO_COUNTH: return (uint8_t)(packets >> 8);
        case ICM_FIFO_COUNTL: return (uint8_t)packets;
        case ICM_FIFO_DATA: return next_of_fifo(c);
        default: break;
        }
        return address >= ICM_ACCEL_DATA_X1 && address <= ICM_GYRO_DATA_Z0 ? sample_byte(c, address)
                                                                           : c->reg[0][address];
    }
    if (is_lsm(c)) {
        if (address >= LSM_TIMESTAMP0 && address <= LSM_TIMESTAMP3) {
            return (uint8_t)(ticks_at(c, board_now()) >> (8 * (address - LSM_TIMESTAMP0)));
        }
        switch (address) {
        case LSM_FIFO_STATUS1: return (uint8_t)words;
        case LSM_FIFO_STATUS2: return (uint8_t)(words >> 8 & 1);
        case LSM_OUT_TEMP_L: return 0x00;
        case LSM_OUT_TEMP_H: return 0x06; /* 31 deg C */
        default: break;
        }
        if (address >= LSM_FIFO_DATA_OUT_TAG && address <= LSM_FIFO_DATA_OUT_Z_H) {
            return next_of_fifo(c);
        }
        return address >= LSM_OUTX_L_G && address <= LSM_OUTZ_H_A ? sample_byte(c, address)
                                                                  : c->reg[0][address];
    }
    return !is_icm(c) && address < 6 ? sample_byte(c, address) : c->reg[c->bank & 1][address];
}

static void write_register(struct sim_chip *c, uint8_t address, uint8_t value)
{
    if (is_icm(c) && address == ICM_REG_BANK_SEL) {
        c->bank = value & 7;
        return;
    }
    const bool is_mmc = !is_icm(c) && !is_lsm(c);
    const bool reset =
        (is_icm(c) && c->bank == 0 && address == ICM_DEVICE_CONFIG && (value & 1)) ||
        (is_lsm(c) && address == LSM_CTRL3 && (value & 1)) ||
        (is_mmc && address == MMC_CONTROL1 && (value & 0x80));
    if (reset) {
        sim_chip_power(c);
        return;
    }
    if (is_icm(c) && address == ICM_SIGNAL_PATH_RESET && (value & 4)) { /* strobe of the time stamp */
        const uint32_t ticks = ticks_at(c, board_now());
        for (int k = 0; k < 3; k++) {
            c->reg[1][ICM_TMSTVAL0 + k] = (uint8_t)((ticks & 0xFFFFF) >> (8 * k));
        }
    }
    const bool empties =
        (is_icm(c) && ((address == ICM_SIGNAL_PATH_RESET && (value & 2)) ||
                       (address == ICM_FIFO_CONFIG && value == 0))) ||
        (is_lsm(c) && address == LSM_FIFO_CTRL4 && value == 0);
    if (empties) {
        c->first = c->used = c->lost = 0;
    }
    if (is_mmc && address == MMC_STATUS) { /* a one clears the flag */
        c->reg[0][MMC_STATUS] = (uint8_t)(c->reg[0][MMC_STATUS] & ~value);
        return;
    }
    c->reg[c->bank & 1][address] = value;
}

void sim_chip_transfer(struct sim_chip *c, const uint8_t *out, size_t n_out, uint8_t *in,
                       size_t n_in)
{
    uint8_t address = out[0] & 0x7F;
    catch_up(c);
    for (size_t k = 1; k < n_out; k++) {
        write_register(c, address++ & 0x7F, out[k]);
    }
    for (size_t k = 0; k < n_in; k++) {
        in[k] = read_register(c, address);
        const bool stays = (is_icm(c) && address == ICM_FIFO_DATA) ||
                           (is_lsm(c) && address == LSM_FIFO_DATA_OUT_Z_H);
        address = stays ? (is_lsm(c) ? LSM_FIFO_DATA_OUT_TAG : address)
                        : (uint8_t)((address + 1) & 0x7F);
    }
}

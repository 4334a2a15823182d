/* MMC5983MA, magnetometer: MEMSIC data sheet rev. A. No FIFO, no clock: a sample's time is that at
 * which it is seen to be ready. */
#include "core/messages.h"
#include "sensors/driver.h"

enum {
    XOUT0 = 0x00,
    STATUS = 0x08,
    CONTROL0 = 0x09,
    CONTROL1 = 0x0A,
    CONTROL2 = 0x0B,
    PRODUCT_ID = 0x2F
};
#define COUNT_TESLA 2.44140625e-8f /* 4096 counts a gauss */

static bool probe(const struct hs_bus *bus)
{
    uint8_t who = 0;
    return hs_read_registers(bus, PRODUCT_ID, &who, 1) && who == 0x30;
}

static bool reset(const struct hs_bus *bus) { return hs_write_register(bus, CONTROL1, 0x80); }

static bool choose(float hz, const float *ranges, struct hs_setting *s)
{
    static const struct {
        float hz;
        uint8_t code;
    } rates[] = {{10, 2}, {20, 3}, {50, 4}, {100, 5}};
    size_t k = 0;
    (void)ranges;
    while (k < 4 && rates[k].hz < hz) {
        k++;
    }
    if (k == 4) {
        return false;
    }
    *s = (struct hs_setting){
        .rate = rates[k].code, .hz = rates[k].hz, .scale = {COUNT_TESLA}, .full_scale = {8e-4f}};
    return true;
}

static bool configure(const struct hs_bus *bus, const struct hs_setting *s)
{
    const uint8_t pairs[][2] = {
        {CONTROL0, 0x08}, /* set: the film's direction is known */
        {CONTROL1, 0x00}, /* 100 Hz bandwidth, 8 ms a measurement */
        {CONTROL0, 0x20}, /* set and reset in turn: removes the bridge's offset */
        {CONTROL2, (uint8_t)(0x08 | s->rate)}, /* continuous */
    };
    return hs_write_registers(bus, pairs, sizeof pairs / sizeof pairs[0]);
}

static bool read_now(const struct hs_bus *bus, int16_t *value)
{
    uint8_t b[6];
    if (!hs_read_registers(bus, XOUT0, b, sizeof b)) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        const int32_t counts = (b[2 * k] << 8 | b[2 * k + 1]) - 32768;
        value[k] = (int16_t)(counts == HS_MISSING ? -32767 : counts);
    }
    return true;
}

static int drain(const struct hs_bus *bus, struct hs_partial *partial, struct hs_reading *readings,
                 int most)
{
    uint8_t status = 0;
    (void)partial;
    if (!hs_read_registers(bus, STATUS, &status, 1) || (status & 0xE0) != 0) {
        return -1;
    }
    if (most < 1 || (status & 1) == 0) {
        return 0;
    }
    readings[0].ticks = 0;
    return read_now(bus, readings[0].value) && hs_write_register(bus, STATUS, 1) ? 1 : -1;
}

const struct hs_driver hs_mmc5983ma = {
    .name = "MMC5983MA",
    .quantities = HS_MAG,
    .axes = 3,
    .start_ms = 15,
    .settle_ms = 20,
    .probe = probe,
    .reset = reset,
    .choose = choose,
    .configure = configure,
    .read_now = read_now,
    .drain = drain,
};

/* What the core asks of a sensor chip; one table a chip, all numbers from its data sheet. */
#ifndef HS_DRIVER_H
#define HS_DRIVER_H

#include "boards/board.h"
#include "core/limits.h"

#define HS_STANDARD_GRAVITY 9.80665f
#define HS_I2C_BYTES 32        /* that an I2C controller's buffer holds on every board */
#define HS_DEGREE 0.017453293f /* rad */

struct hs_reading {
    uint32_t ticks; /* the sensor's own clock at the sample, its lowest `stamp_bits` */
    int16_t value[HS_AXES];
};

/* Words of a sample whose rest is still in the FIFO. */
struct hs_partial {
    uint8_t count, has;
    struct hs_reading reading;
};

/* What a chip is set to, and what its counts then mean. */
struct hs_setting {
    uint8_t range[2];    /* chip's code, by quantity */
    uint8_t rate;        /* chip's code */
    float hz;            /* nominal rate of the chip's samples */
    float scale[2];      /* SI per count */
    float full_scale[2]; /* SI */
};

struct hs_driver {
    const char *name;
    uint8_t quantities; /* enum hs_quantity, lowest bit first in a sample */
    uint8_t axes;
    bool has_clock; /* samples carry the chip's own time */
    uint8_t stamp_bits, sync_bits;
    uint32_t tick;                                   /* ns, nominal */
    uint16_t start_ms;                               /* from reset to registers that answer */
    uint16_t settle_ms;                              /* from configured to samples that count */
    int16_t test_least[HS_AXES], test_most[HS_AXES]; /* counts by which self-test moves each axis */

    bool (*probe)(const struct hs_bus *bus); /* whether this chip answers */
    bool (*reset)(const struct hs_bus *bus);
    /* Smallest ranges that reach what is wanted (0: the default) and a rate of at least `hz`; false
     * where the chip cannot. */
    bool (*choose)(float hz, const float *ranges, struct hs_setting *setting);
    bool (*configure)(const struct hs_bus *bus, const struct hs_setting *setting);
    bool (*excite)(const struct hs_bus *bus, bool on); /* self-test */
    bool (*read_now)(const struct hs_bus *bus, int16_t *value);
    bool (*sync)(const struct hs_bus *bus, uint32_t *ticks); /* the chip's clock at this moment */
    /* Readings that wait, at most `most`; -1 where the chip talks nonsense. */
    int (*drain)(const struct hs_bus *bus, struct hs_partial *partial, struct hs_reading *readings,
                 int most);
    bool (*temperature)(const struct hs_bus *bus, float *celsius);
};

extern const struct hs_driver hs_lsm6dsv16x, hs_icm42688p, hs_mmc5983ma;

/* Registers of a chip that reads with bit 7 of the address set over SPI, and with the bare address
 * over I2C. */
bool hs_write_register(const struct hs_bus *bus, uint8_t address, uint8_t value);
bool hs_read_registers(const struct hs_bus *bus, uint8_t address, uint8_t *bytes, size_t n);

/* Write pairs of address and value in order. */
bool hs_write_registers(const struct hs_bus *bus, const uint8_t (*pairs)[2], size_t n);

static inline int16_t hs_little(const uint8_t *b) { return (int16_t)(uint16_t)(b[0] | b[1] << 8); }
static inline int16_t hs_big(const uint8_t *b) { return (int16_t)(uint16_t)(b[1] | b[0] << 8); }

#endif

#include "sensors/driver.h"

bool hs_write_register(const struct hs_bus *bus, uint8_t address, uint8_t value)
{
    const uint8_t out[2] = {address, value};
    return board_transfer(bus, out, sizeof out, NULL, 0);
}

bool hs_read_registers(const struct hs_bus *bus, uint8_t address, uint8_t *bytes, size_t n)
{
    const uint8_t out = bus->i2c_address == 0 ? address | 0x80 : address;
    return board_transfer(bus, &out, 1, bytes, n);
}

bool hs_write_registers(const struct hs_bus *bus, const uint8_t (*pairs)[2], size_t n)
{
    bool done = true;
    for (size_t k = 0; k < n; k++) {
        done = hs_write_register(bus, pairs[k][0], pairs[k][1]) && done;
    }
    return done;
}

/* Microchip 25LC640A (DS21830): SPI EEPROM of 8192 bytes, pages of 32, at most 5 ms a page. */
#include "boards/board.h"
#include "core/strip_memory.h"

enum { WRITE = 0x02, READ = 0x03, WRITE_DISABLE = 0x04, READ_STATUS = 0x05, WRITE_ENABLE = 0x06 };
enum { PAGE = 32, IN_PROGRESS = 1, LATCH = 2, PATIENCE = 100 /* of 100 us */ };

static struct hs_bus chip(uint8_t slot) { return (struct hs_bus){slot, HS_SELECT_MEMORY, 0}; }

static bool command(uint8_t slot, uint8_t code)
{
    const struct hs_bus bus = chip(slot);
    return board_transfer(&bus, &code, 1, NULL, 0);
}

static uint8_t status(uint8_t slot)
{
    const struct hs_bus bus = chip(slot);
    const uint8_t code = READ_STATUS;
    uint8_t value = 0xFF;
    return board_transfer(&bus, &code, 1, &value, 1) ? value : 0xFF;
}

static bool is_ready(uint8_t slot)
{
    for (int k = 0; k < PATIENCE; k++) {
        if ((status(slot) & IN_PROGRESS) == 0) {
            return true;
        }
        board_feed_watchdog();
        board_wait(100);
    }
    return false;
}

bool hs_eeprom_probe(uint8_t slot)
{
    if (!command(slot, WRITE_ENABLE) || (status(slot) & (0x70 | LATCH)) != LATCH) {
        return false;
    }
    return command(slot, WRITE_DISABLE) &&
           (status(slot) & (0x70 | LATCH)) == 0; /* the latch follows: it is no stuck line */
}

bool hs_eeprom_read(uint8_t slot, uint16_t address, uint8_t *bytes, size_t n)
{
    const struct hs_bus bus = chip(slot);
    const uint8_t out[3] = {READ, (uint8_t)(address >> 8), (uint8_t)address};
    return board_transfer(&bus, out, sizeof out, bytes, n);
}

bool hs_eeprom_write(uint8_t slot, uint16_t address, const uint8_t *bytes, size_t n)
{
    const struct hs_bus bus = chip(slot);
    uint8_t out[3 + PAGE];
    while (n > 0) {
        const size_t room = PAGE - address % PAGE, part = n < room ? n : room;
        out[0] = WRITE;
        out[1] = (uint8_t)(address >> 8);
        out[2] = (uint8_t)address;
        memcpy(out + 3, bytes, part);
        if (board_supply_is_low() || !command(slot, WRITE_ENABLE) ||
            !board_transfer(&bus, out, 3 + part, NULL, 0) || !is_ready(slot)) {
            return false;
        }
        address = (uint16_t)(address + part);
        bytes += part;
        n -= part;
    }
    return true;
}

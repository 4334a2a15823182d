/* What the core asks of a board: these functions and a C library. Times are ns since power-up and
 * never run back. */
#ifndef HS_BOARD_H
#define HS_BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define HS_SELECT_MEMORY 255 /* the strip's memory chip */

/* One chip: its strip's connector, its select line on the strip, its I2C address (0: SPI). */
struct hs_bus {
    uint8_t slot, select, i2c_address;
};

uint64_t board_now(void);
void board_wait(uint32_t microseconds);

/* Select the chip, send `n_out` bytes, then read `n_in`, deselect. False where the bus says that
 * nobody answers (I2C). */
bool board_transfer(const struct hs_bus *bus, const uint8_t *out, size_t n_out, uint8_t *in,
                    size_t n_in);

/* To and from the host; both give the bytes that went, 0 and more, at once. */
size_t board_send(const uint8_t *bytes, size_t n);
size_t board_receive(uint8_t *bytes, size_t n);

/* Two pages of HS_PAGE bytes a slot in the base unit's own flash, for strips without a memory chip;
 * writing erases the page first. False: there are none. */
bool board_flash_read(uint8_t page, uint8_t *bytes, size_t n);
bool board_flash_write(uint8_t page, const uint8_t *bytes, size_t n);

uint32_t board_random(void); /* differs from power-up to power-up */
void board_feed_watchdog(void);
bool board_supply_is_low(void);        /* brown-out: nothing is written to flash any more */
uint8_t board_battery(void);           /* %, 255 = on USB power */
bool board_show_cue(const char *task); /* lamp or sound; false where the task is not known */

#endif

/* What a strip knows of itself, in two copies with a number and a checksum each: a power cut while
 * one is written leaves the other. */
#ifndef HS_STRIP_MEMORY_H
#define HS_STRIP_MEMORY_H

#include "core/messages.h"

struct hs_strip_record {
    uint64_t strip_id; /* 0: none was read */
    uint8_t n;
    uint8_t points[HS_PER_STRIP];
    struct hs_calibration calibration[HS_PER_STRIP];
};

enum hs_memory_kind { HS_NO_MEMORY, HS_CHIP, HS_BASE_FLASH };

struct hs_strip_memory {
    uint8_t slot;
    enum hs_memory_kind kind;
    uint32_t number; /* of the newest valid copy */
    uint8_t copy;    /* which one that is; 255: none */
};

/* Find the strip's memory and its newest valid record; false where none is valid. */
bool hs_strip_memory_open(struct hs_strip_memory *memory, uint8_t slot,
                          struct hs_strip_record *record);

/* Write the other copy and read it back; false where the memory did not keep it: the copy before
 * still holds. */
bool hs_strip_memory_write(struct hs_strip_memory *memory, const struct hs_strip_record *record);

/* 25LC640 and alike on the strip's bus: 8192 bytes by SPI, pages of 32 (sensors/eeprom_25lc640.c).
 */
bool hs_eeprom_probe(uint8_t slot);
bool hs_eeprom_read(uint8_t slot, uint16_t address, uint8_t *bytes, size_t n);
bool hs_eeprom_write(uint8_t slot, uint16_t address, const uint8_t *bytes, size_t n);

#endif

#include "core/strip_memory.h"

#include "boards/board.h"
#include "core/crc32.h"

#define MAGIC 0x31535348u /* "HSS1" */
#define EACH 145          /* point and 36 numbers */

static uint8_t page[HS_PAGE]; /* one at a time is in work */

static bool read_copy(const struct hs_strip_memory *m, uint8_t copy, size_t n)
{
    if (m->kind == HS_CHIP) {
        return hs_eeprom_read(m->slot, (uint16_t)(copy * HS_PAGE), page, n);
    }
    return m->kind == HS_BASE_FLASH && board_flash_read((uint8_t)(2 * m->slot + copy), page, n);
}

static bool write_copy(const struct hs_strip_memory *m, uint8_t copy, size_t n)
{
    if (m->kind == HS_CHIP) {
        return hs_eeprom_write(m->slot, (uint16_t)(copy * HS_PAGE), page, n);
    }
    return m->kind == HS_BASE_FLASH && board_flash_write((uint8_t)(2 * m->slot + copy), page, n);
}

/* The record in `page`; false where its checksum or what it says is wrong. */
static bool parse(struct hs_strip_record *record, uint32_t *number)
{
    struct hs_reader r = {page, HS_PAGE, 0, false};
    const uint32_t magic = (uint32_t)hs_get_uint(&r, 4);
    *number = (uint32_t)hs_get_uint(&r, 4);
    const size_t size = (size_t)hs_get_uint(&r, 2);
    if (magic != MAGIC || size > HS_PAGE - 14 || size < 9) {
        return false;
    }
    r.at = 10 + size;
    if ((uint32_t)hs_get_uint(&r, 4) != hs_crc32(page, 10 + size)) {
        return false;
    }
    r.at = 10;
    record->strip_id = hs_get_uint(&r, 8);
    record->n = (uint8_t)hs_get_uint(&r, 1);
    if (record->n > HS_PER_STRIP || size != 9u + EACH * (size_t)record->n) {
        return false;
    }
    for (uint8_t k = 0; k < record->n; k++) {
        record->points[k] = (uint8_t)hs_get_uint(&r, 1);
        hs_get_calibration(&r, &record->calibration[k]);
        if (record->points[k] > HS_LAST_POINT || !hs_is_finite(&record->calibration[k])) {
            return false;
        }
    }
    return record->strip_id != 0;
}

static size_t build(const struct hs_strip_record *record, uint32_t number)
{
    struct hs_writer w = {page, HS_PAGE, 0, false};
    hs_put_uint(&w, MAGIC, 4);
    hs_put_uint(&w, number, 4);
    hs_put_uint(&w, 9u + EACH * (uint64_t)record->n, 2);
    hs_put_uint(&w, record->strip_id, 8);
    hs_put_uint(&w, record->n, 1);
    for (uint8_t k = 0; k < record->n; k++) {
        hs_put_uint(&w, record->points[k], 1);
        hs_put_calibration(&w, &record->calibration[k]);
    }
    hs_put_uint(&w, hs_crc32(page, w.at), 4);
    return w.full ? 0 : w.at;
}

static enum hs_memory_kind memory_of(uint8_t slot)
{
    return hs_eeprom_probe(slot)                            ? HS_CHIP
           : board_flash_read((uint8_t)(2 * slot), page, 1) ? HS_BASE_FLASH
                                                            : HS_NO_MEMORY;
}

bool hs_strip_memory_open(struct hs_strip_memory *m, uint8_t slot, struct hs_strip_record *record)
{
    static struct hs_strip_record found;
    *m = (struct hs_strip_memory){.slot = slot, .kind = memory_of(slot), .copy = 255};
    for (uint8_t copy = 0; copy < 2; copy++) {
        uint32_t number = 0;
        if (read_copy(m, copy, HS_PAGE) && parse(&found, &number) &&
            (m->copy == 255 || (int32_t)(number - m->number) > 0)) {
            m->copy = copy;
            m->number = number;
            *record = found;
        }
    }
    return m->copy != 255;
}

bool hs_strip_memory_write(struct hs_strip_memory *m, const struct hs_strip_record *record)
{
    const uint8_t other = m->copy == 0 ? 1 : 0;
    const size_t n = build(record, m->number + 1);
    const uint32_t crc = hs_crc32(page, n);
    if (n == 0 || m->kind == HS_NO_MEMORY || board_supply_is_low() || !write_copy(m, other, n)) {
        return false;
    }
    if (!read_copy(m, other, n) || hs_crc32(page, n) != crc) {
        return false;
    }
    m->copy = other;
    m->number++;
    return true;
}

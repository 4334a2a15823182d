/* Frames on their way to the host: numbered, stuffed, and held back in a ring while the host takes
 * no bytes. */
#ifndef HS_OUTBOX_H
#define HS_OUTBOX_H

#include "core/bytes.h"
#include "core/limits.h"

struct hs_outbox {
    uint8_t ring[HS_OUTBOX];
    size_t first, used;
    uint16_t sequence;
    uint32_t overruns; /* frames dropped since power-up because the host did not take the bytes */
    uint8_t body[HS_BODY + 4];
    uint8_t stuffed[HS_BODY + HS_BODY / 254 + 16];
    struct hs_writer payload;
};

/* Begin a frame of this type; its payload is written to the writer that this gives. */
struct hs_writer *hs_outbox_begin(struct hs_outbox *outbox, uint8_t type);

/* Number, check and queue the frame; false where there is no room: it is dropped whole, counted,
 * and its number is used up. */
bool hs_outbox_end(struct hs_outbox *outbox);

/* The next contiguous bytes to send, and to say how many of them the host took. */
size_t hs_outbox_peek(const struct hs_outbox *outbox, const uint8_t **bytes);
void hs_outbox_drop(struct hs_outbox *outbox, size_t n);

/* Nobody listens any more: what waits is of no use to whoever comes next. */
void hs_outbox_clear(struct hs_outbox *outbox);

#endif

#include "core/outbox.h"

#include "core/cobs.h"
#include "core/crc32.h"

struct hs_writer *hs_outbox_begin(struct hs_outbox *outbox, uint8_t type)
{
    outbox->payload = (struct hs_writer){outbox->body, HS_BODY, 0, false};
    hs_put_uint(&outbox->payload, type, 1);
    hs_put_uint(&outbox->payload, outbox->sequence++, 2);
    return &outbox->payload;
}

static void append(struct hs_outbox *outbox, const uint8_t *bytes, size_t n)
{
    const size_t at = (outbox->first + outbox->used) % HS_OUTBOX;
    const size_t before_end = n < HS_OUTBOX - at ? n : HS_OUTBOX - at;
    memcpy(outbox->ring + at, bytes, before_end);
    memcpy(outbox->ring, bytes + before_end, n - before_end);
    outbox->used += n;
}

bool hs_outbox_end(struct hs_outbox *outbox)
{
    struct hs_writer *w = &outbox->payload;
    const bool whole = !w->full;
    w->size = sizeof outbox->body;
    w->full = false;
    hs_put_uint(w, hs_crc32(outbox->body, w->at), 4);
    size_t n = hs_cobs_encode(outbox->body, w->at, outbox->stuffed);
    outbox->stuffed[n++] = 0;
    if (!whole || n > HS_OUTBOX - outbox->used) {
        outbox->overruns++;
        return false;
    }
    append(outbox, outbox->stuffed, n);
    return true;
}

size_t hs_outbox_peek(const struct hs_outbox *outbox, const uint8_t **bytes)
{
    *bytes = outbox->ring + outbox->first;
    return outbox->used < HS_OUTBOX - outbox->first ? outbox->used : HS_OUTBOX - outbox->first;
}

void hs_outbox_drop(struct hs_outbox *outbox, size_t n)
{
    outbox->first = (outbox->first + n) % HS_OUTBOX;
    outbox->used -= n;
}

void hs_outbox_clear(struct hs_outbox *outbox) { outbox->first = outbox->used = 0; }
